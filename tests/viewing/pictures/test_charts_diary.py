"""The picture of a diary: its bytes, and names that can't be a picture's."""

import pytest

from fleet2d.errors import InputError
from fleet2d.routines.persona import bundled_persona
from fleet2d.viewing.pictures.charts import diary_days, draw_diary


def test_the_same_days_give_the_same_picture(tmp_path):
    persona = bundled_persona("works_outside")
    days = diary_days(persona, 1, 4)
    for name in ("a.svg", "b.svg"):
        draw_diary(persona, "works_outside", days, tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_a_diary_is_drawn_as_a_picture_only(tmp_path):
    persona = bundled_persona("works_outside")
    with pytest.raises(InputError, match=r"not as \.abc|not as '\.abc'"):
        draw_diary(persona, "works_outside", diary_days(persona, 1, 4), tmp_path / "diary.abc")
