"""Messages of other programs: their size is bounded before they are read."""

import pytest

from fleet2d.errors import InputError
from fleet2d.live.messages import MAX_BYTES, parse_message

GOAL = '{"type": "goal", "entity": "astro", "to": "kitchen"}'


def test_a_message_may_have_as_many_bytes_as_the_bound_and_no_more() -> None:
    longest = GOAL.ljust(MAX_BYTES)
    assert parse_message(GOAL) == parse_message(longest)
    with pytest.raises(InputError, match="a message of 1048577 bytes; 1048576 are allowed"):
        parse_message(longest + " ")
