"""A small data set that the tests share."""

import pytest
from tests.learning.datasets.small import made


@pytest.fixture(scope="session")
def data():
    """A small data set, made once."""
    return made()
