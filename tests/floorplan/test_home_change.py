"""Changes of a home, as a scenario writes them."""

import pytest
from pydantic import ValidationError

from fleet2d.floorplan.home import HomeChange, HomeChanges


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({}, "got nothing"),
        ({"open": "a", "shut": "a"}, "got open and shut"),
        ({"move": "sofa_1"}, "'move' and 'to' go together"),
        ({"room": "office_1"}, "'room' and 'type' go together"),
        ({"shut": "a", "to": (1, 2)}, "'move' and 'to' go together"),
    ],
)
def test_change_that_is_not_exactly_one_is_refused(settings, words):
    with pytest.raises(ValidationError, match=words):
        HomeChange(**settings)


def test_changes_become_columns_in_their_order():
    output = HomeChanges([HomeChange(open="b"), HomeChange(move="sofa_1", to=(1, 2))])
    columns = output.to_columns()
    assert ["open", "move"] == columns["change"].tolist()
    assert ["b", "sofa_1"] == columns["target"].tolist()
