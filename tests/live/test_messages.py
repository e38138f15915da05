"""Messages of other programs: their size is bounded before they are read."""

import pytest

from fleet2d.errors import InputError
from fleet2d.live.messages import MAX_BYTES, MAX_NUMBER, parse_message

GOAL = '{"type": "goal", "entity": "astro", "to": "kitchen"}'


def test_a_message_may_have_as_many_bytes_as_the_bound_and_no_more():
    longest = GOAL.ljust(MAX_BYTES)
    assert parse_message(GOAL) == parse_message(longest)
    with pytest.raises(InputError, match="a message of 1048577 bytes; 1048576 are allowed"):
        parse_message(longest + " ")


def test_a_number_of_thousands_of_digits_is_refused():
    """The sum of those that were lost had too many digits to be told, and ended the run."""
    reading = '{"type": "reading", "sensor": "door", "on": true, "number": NUMBER}'
    assert parse_message(reading.replace("NUMBER", str(MAX_NUMBER))).number == MAX_NUMBER
    with pytest.raises(InputError, match=r"reading\.number: Input should be less than or equal"):
        parse_message(reading.replace("NUMBER", "9" * 4300))
