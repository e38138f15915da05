"""Changes of a home, as a scenario writes them."""

from datetime import datetime, timedelta

import pytest
from pydantic import ValidationError

from fleet2d.floorplan.home import HomeChange, HomeChanges


@pytest.mark.parametrize(
    ("text", "moment"),
    [
        ("2 d 14 h", timedelta(days=2, hours=14)),
        ("2026-01-07T14:00", datetime(2026, 1, 7, 14)),
        ("2026-01-07", datetime(2026, 1, 7)),
    ],
)
def test_moment_is_a_local_time_or_the_time_since_the_start(text: str, moment: object) -> None:
    change = HomeChange(at=text, shut="door")
    assert moment == change.at
    assert change == HomeChange.model_validate(change.model_dump(mode="json"))


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({}, "got nothing"),
        ({"open": "a", "shut": "a"}, "got open and shut"),
        ({"move": "sofa_0"}, "'move' and 'to' go together"),
        ({"room": "office_0"}, "'room' and 'type' go together"),
        ({"shut": "a", "to": (1, 2)}, "'move' and 'to' go together"),
        ({"shut": "a", "at": "2026-01-07T14:00+01:00"}, "without a time zone"),
    ],
)
def test_change_that_is_not_exactly_one_is_refused(settings: dict, words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        HomeChange(**settings)


def test_changes_become_columns_in_their_order() -> None:
    output = HomeChanges([HomeChange(open="b"), HomeChange(move="sofa_0", to=(1, 2))])
    columns = output.to_columns()
    assert ["open", "move"] == columns["change"].tolist()
    assert ["b", "sofa_0"] == columns["target"].tolist()
