"""Holonomic robots: never stopping, turning while they drive or not at all."""

from tests.entities.drives.drives import driven

from fleet2d.entities.drives.holonomic import Holonomic


def test_it_turns_while_it_drives() -> None:
    assert [
        (6.0, 3.0, 0.0, 0.0),
        (7.0, 3.0, 0.5, 90.0),  # a quarter turn takes a second, half a metre
        (10.0, 3.0, 2.0, 90.0),
    ] == driven(Holonomic())


def test_it_turns_the_shorter_way_as_far_as_the_way_lasts() -> None:
    assert [(0.5, 0.25, 0.0, 315.0)] == driven(Holonomic(), [(0, 0), (0.25, 0)], heading_deg=270)
    assert [(0.5, 0.0, 0.25, 45.0), (1.0, 0.0, 0.5, 90.0)] == driven(
        Holonomic(), [(0, 0), (0, 0.25), (0, 0.5)]
    )


def test_it_keeps_its_heading_if_it_never_turns() -> None:
    assert [(6.0, 3.0, 0.0, 45.0), (10.0, 3.0, 2.0, 45.0)] == driven(
        Holonomic(turns=False), heading_deg=45
    )
