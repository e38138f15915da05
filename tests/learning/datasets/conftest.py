"""A small data set that the tests share."""

import pytest
from tests.learning.datasets.small import made

from fleet2d.learning.datasets.reader import Dataset


@pytest.fixture(scope="session")
def data() -> Dataset:
    """A small data set, made once."""
    return made()
