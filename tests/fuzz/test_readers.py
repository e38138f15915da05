"""A short hunt in every reader, and all that earlier hunts have found.

An hour of it, before a release: `python -m tests.fuzz --minutes 60`.
"""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from tests.fuzz.judge import judge
from tests.fuzz.readers import READERS
from tests.thorough import examples

EXAMPLES = examples(60)
FINDS = sorted((Path(__file__).parent / "finds").glob("*-*"))
"""Contents that a reader has failed at, as NAME OF THE READER-NUMBER."""


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_what_is_nearly_right_is_read_or_refused(name):
    reader = READERS[name]

    @settings(
        max_examples=max(4, EXAMPLES // reader.cost),
        deadline=None,
        database=None,
        derandomize=True,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(st.deferred(reader.contents))
    def hunt(content):
        assert "" == judge(reader, content)

    hunt()


@pytest.mark.parametrize("find", FINDS, ids=lambda path: path.name)
def test_what_was_found_once_stays_mended(find):
    reader = READERS[find.name.rpartition("-")[0]]
    assert "" == judge(reader, find.read_bytes())
