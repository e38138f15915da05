"""Messages: on a terminal they do nothing but say what is wrong."""

import pytest

from fleet2d.errors import ComponentError, Fleet2DError, InputError, RunDirectoryError


@pytest.mark.parametrize("kind", [ComponentError, Fleet2DError, InputError, RunDirectoryError])
def test_control_characters_of_a_message_are_escaped(kind):
    error = kind("home\x1b[2J\x9b2J\u202e is\n\tno home\r")
    assert "home\\x1b[2J\\x9b2J\\u202e is\n\tno home\\r" == str(error)
