"""Expectations: conditions that must hold over a run, with their violations.

```python
from fleet2d.expectations import always, after, distance, events, seen

always(distance("ana", "astro") > 0.5)
after(events("calls", "astro"), seen("ana", by="astro"), within="2 min")
```
"""

from typing import TYPE_CHECKING, Any

from fleet2d.expectations.expectation import WORDS
from fleet2d.expectations.expectation import Expectation as Expectation
from fleet2d.expectations.parse import parse_expectation as parse_expectation
from fleet2d.expectations.signals import Scene as Scene
from fleet2d.expectations.temporal import Violation as Violation
from fleet2d.expectations.verdict import Verdict as Verdict

if TYPE_CHECKING:
    from fleet2d.expectations.learned import *  # noqa: F403
    from fleet2d.expectations.temporal import *  # noqa: F403
    from fleet2d.expectations.vocabulary import *  # noqa: F403
else:  # every word, whichever module defines it
    __all__ = sorted({"Expectation", "Scene", "Verdict", "Violation", "parse_expectation", *WORDS})

    def __getattr__(name: str) -> Any:
        if name not in WORDS:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return WORDS[name]
