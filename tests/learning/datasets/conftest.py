"""A small data set that the tests share."""

import pytest
from tests.learning.datasets.small import make

from fleet2d.learning.datasets.reader import Dataset


@pytest.fixture(scope="session")
def data(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """A small data set, made once."""
    return make(tmp_path_factory.mktemp("data") / "small")
