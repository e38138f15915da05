"""Expectations: what must hold over a run, with the first and last step of each violation.

```python
from fleet2d.expectations import always, after, distance, events, seen

always(distance("ana", "astro") > 0.5)
after(events("calls", "astro"), seen("ana", by="astro"), within="2 min")
```
"""

from fleet2d.expectations.expectation import Expectation
from fleet2d.expectations.parse import parse_expectation
from fleet2d.expectations.scene import Scene
from fleet2d.expectations.verdict import Verdict, judge
from fleet2d.expectations.violation import Violation
from fleet2d.expectations.vocabulary import (
    activity,
    after,
    always,
    at_end,
    at_most,
    away,
    battery,
    count,
    distance,
    door,
    during,
    events,
    eventually,
    holds_for,
    in_view,
    metric,
    moving,
    never,
    output,
    perceived,
    probability,
    room,
    seen,
    sensor,
    speed,
    until,
)

__all__ = [
    "Expectation",
    "Scene",
    "Verdict",
    "Violation",
    "activity",
    "after",
    "always",
    "at_end",
    "at_most",
    "away",
    "battery",
    "count",
    "distance",
    "door",
    "during",
    "events",
    "eventually",
    "holds_for",
    "in_view",
    "judge",
    "metric",
    "moving",
    "never",
    "output",
    "parse_expectation",
    "perceived",
    "probability",
    "room",
    "seen",
    "sensor",
    "speed",
    "until",
]
