"""What tests of live runs share."""

import gc

import pytest


@pytest.fixture(autouse=True)
def _frozen_again():
    """Leave what was collected out of garbage collections again, which a live run ends.

    Else each later run looks for garbage in all tests, for half a second.
    """
    yield
    gc.freeze()
