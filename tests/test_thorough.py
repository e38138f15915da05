"""Property tests try fixed examples in the ordinary run, and new ones in a thorough run."""

from hypothesis import given
from hypothesis import strategies as st
from tests.thorough import THOROUGH


def drawn():
    """Return what a property test is given in one run."""
    values = []

    @given(st.integers())
    def collect(value):
        values.append(value)

    collect()
    return values


def test_examples_are_new_only_if_it_is_thorough():
    """The tests failed once in a fresh clone, at an example that nobody had drawn before."""
    assert THOROUGH == (drawn() != drawn())
