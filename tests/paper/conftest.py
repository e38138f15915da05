"""What the tests of the paper's results share."""

from collections.abc import Iterator

import pytest

from fleet2d.paper import months
from fleet2d.studies.executors import SerialExecutor


@pytest.fixture(scope="module")
def serial() -> Iterator[None]:
    """Run months in this process: starting others takes longer than such short months."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(months, "LocalExecutor", lambda workers: SerialExecutor())
        yield
