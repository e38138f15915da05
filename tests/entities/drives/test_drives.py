"""Drives in whole runs: every kind, whatever robots do; a user's own; and what is refused."""

import copy
from collections.abc import Iterable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from tests.entities.drives.drives import CORNER, driven
from tests.entities.robots.robots import assert_same_for_every_max_span, events, home_with
from tests.scenes import digests, path, run, table
from tests.thorough import some

import fleet2d
from fleet2d import Behavior, Drive, Moment, Plan, Route, Situation
from fleet2d.configuration.components import components
from fleet2d.entities.drives.drive import estimate
from fleet2d.entities.robots.approach import way_seconds
from fleet2d.errors import ComponentError, ScenarioError
from fleet2d.scenario.compose import compose

OTHERS = sorted(set(components("drive")) - {"differential"})
BATTERY = {"driving": "4 min", "standing": "20 min", "charging": "2 min", "charger": [1.0, 3.0]}
GO = {"type": "patrol", "waypoints": [[4.0, 3.0]], "dwell": "1 d", "look_around": False}


class Returned(Drive):
    """Returns moments that a test sets."""

    moments_of_test: ClassVar[Any] = ()

    def moments(self, route: Route) -> Iterable[Moment]:
        if isinstance(self.moments_of_test, Exception):
            raise self.moments_of_test
        return [Moment(*moment) for moment in self.moments_of_test]


class Flight(Drive):
    """Drives at ten times its speed, and mentions only the end."""

    def moments(self, route: Route) -> list[Moment]:
        metres = sum(leg.length for leg in route.legs)
        return [Moment(metres / route.speed / 10, metres, route.legs[-1].direction)]


class Sit(Behavior):
    """Sits down on the chair."""

    def decide(self, now: Situation) -> Plan | None:
        return now.plan().use("chair_0").stay()


def busy(drive: Any) -> dict[str, Any]:
    """Robots that do all that robots do, and are in each other's and in people's way."""
    behaviors = [
        {"type": "dock", "until": "40 %"},
        "come",
        {"type": "find", "user": "ana", "every": "4 min"},
        {"type": "opportunistic", "interaction": "10 s", "again": "5 min"},
        {"type": "follow", "when": "07:10-07:12", "longest": "1 min"},
        {"type": "patrol", "when": "07:12-07:13", "dwell": "5 s"},
        {"type": "hangout", "period": "2 min", "explore": "50 %"},
    ]
    content = home_with(
        behaviors,
        "15 min",
        {"type": "routine", "persona": "works_from_home"},
        astro={"drive": drive, "battery": BATTERY, "gives_way": {"patience": "3 s"}},
        simulation={"people_block": "3 s"},
        script=[
            {"call": "astro", "to": "bedroom", "at": "07:08"},
            {"put": "bolt", "to": "kitchen", "at": "07:04:05"},
        ],
        artifacts={"trajectories": "every step"},
    )
    content["users"]["ben"] = {"type": "meander"}
    content["robots"]["bolt"] = {"type": "patrol", "dwell": "5 s", "drive": drive}
    return content


@pytest.mark.parametrize("drive", some(list(OTHERS), 2))
def test_a_run_is_the_same_for_every_span_and_continues_from_a_copy_and_from_a_file(
    drive: str, tmp_path: Path
) -> None:
    content = busy(drive)
    whole = assert_same_for_every_max_span(content, 600, 7, 1)
    kinds = {name for _, name, _ in events(whole)}
    assert {"docks", "find_begins", "relocates", "gives_way", "called"} <= kinds
    for robot in ("astro", "bolt"):
        rows, rebuilt = table(whole, "trajectories", entity=robot), path(whole, robot)
        assert rows["x"].tolist() == rebuilt.x.tolist()
        assert rows["heading"].tolist() == rebuilt.heading.tolist()

    simulation = fleet2d.Simulation(content)
    simulation.advance(537)
    branch = copy.deepcopy(simulation)
    simulation.save(tmp_path / "half.sim")
    assert digests(whole) == digests(branch.run())
    assert digests(whole) == digests(fleet2d.Simulation.load(tmp_path / "half.sim").run())


@pytest.mark.parametrize("drive", OTHERS)
def test_a_robot_stays_on_its_routes(drive: str) -> None:
    """It is where the usual drive would be, only at another time."""
    content = home_with([{"type": "patrol", "dwell": "10 s"}], "10 min")
    usual, other = (
        path(run(content, f"robots.astro.drive={kind}"), "astro")
        for kind in ("differential", drive)
    )
    places = np.stack([usual.x, usual.y], axis=1)
    for x, y in zip(other.x[:400].tolist(), other.y[:400].tolist(), strict=True):
        assert np.hypot(*(places - (x, y)).T).min() < 0.31  # the way of half a second


def test_a_drive_of_ones_own_passes_corners_that_it_does_not_mention() -> None:
    assert [(0.6, 3.0, 0.0), (1.0, 3.0, 2.0)] == [row[:3] for row in driven(Flight())]
    assert [54.0, 90.0] == pytest.approx([row[3] for row in driven(Flight())], abs=0.1)


def test_a_drive_of_ones_own_in_a_file_beside_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "from fleet2d import Drive, Moment, Route\n"
        "class Slow(Drive):\n"
        "    '''Drives slowly.'''\n"
        "    factor: float = 0.5\n"
        "    def moments(self, route: Route) -> list[Moment]:\n"
        "        metres = sum(leg.length for leg in route.legs)\n"
        "        return [Moment(metres / route.speed / self.factor, metres, route.heading)]\n"
    )
    content = home_with([GO], "1 min", astro={"drive": {"type": f"{tmp_path}/mine:Slow"}})
    ways = [
        path(run(content, f"robots.astro.drive.factor={factor}"), "astro").x for factor in (1, 0.25)
    ]

    assert [6, 21] == [int(np.argmax(way > 3.99)) + 1 for way in ways]


@pytest.mark.parametrize(
    ("moments", "words"),
    [
        ([(1, 3, 0)], "ended after 3 m of a route of 5 m"),
        ([], "ended after 0 m of a route of"),
        ([(1, 3, 0), (0.5, 5, 0)], "returned Moment(seconds=0.5, metres=5, heading=0) after"),
        ([(1, 3, 0), (2, 2, 0)], "neither seconds (10 days at most) nor metres may fall"),
        ([(1, 5.1, 0)], "no moment may be past the end"),
        ([(float("nan"), 5, 0)], "returned Moment(seconds=nan"),
        ([(1e9, 5, 0)], "10 days at most"),
        ([(1, 5, 0.5)], "headings are whole numbers"),
    ],
    ids=["too short", "nothing", "back in time", "back", "too far", "nan", "years", "half"],
)
def test_nonsense_is_refused(moments: Any, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Returned, "moments_of_test", moments)
    with pytest.raises(ComponentError) as caught:
        driven(Returned(), CORNER)
    assert words in str(caught.value)


class Hopes(Returned):
    """Estimates what a test sets."""

    estimate: float | list[float]

    def seconds(self, metres: Any, speed: float) -> Any:
        return np.array(self.estimate)


@pytest.mark.parametrize("seconds", [2.0, [1.0], [-1.0, 1.0], [float("nan"), 0.0]])
def test_estimates_that_are_no_times_are_refused(seconds: Any) -> None:
    drive = Hopes.model_construct(estimate=seconds)
    with pytest.raises(ComponentError, match=r"Hopes estimated .* of shape \(2,\)"):
        estimate(drive, np.array([1.0, 2.0]), 0.6)


@pytest.mark.parametrize(
    ("moments", "words"),
    [
        ([], "the drive tests.entities.drives.test_drives:Returned ended after"),
        (KeyError("wheel"), "KeyError: 'wheel'"),
    ],
)
def test_errors_name_robot_drive_and_step(
    moments: Any, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Returned, "moments_of_test", moments)
    with pytest.raises(ComponentError) as caught:
        run(home_with([GO], "1 min", astro={"drive": Returned()}))
    assert str(caught.value).startswith("robots.astro.drive failed at step 0: ")
    assert words in str(caught.value)


def test_robots_think_that_a_way_takes_what_their_drive_takes() -> None:
    times = {}
    for drive in ("differential", "holonomic", "trapezoidal"):
        simulation = fleet2d.Simulation(home_with([], "1 min", astro={"drive": drive}))
        actor = simulation._state.actors[-1]
        times[drive] = way_seconds(actor, actor.point((1, 3)), actor.point((1, 1)))
        assert way_seconds(actor, actor.point((1, 3)), actor.point((1, 3))) == 0
        assert [0, times[drive]] == pytest.approx(
            actor.seconds(np.array([0.0, 2.0])).tolist(), abs=1e-3
        )
    assert times == pytest.approx(
        {"differential": 2 / 0.6, "holonomic": 2 / 0.6, "trapezoidal": 2 / 0.6 + 0.6 / 0.5},
        abs=1e-3,
    )


def test_another_type_in_an_override_replaces_the_keys_of_the_old_one() -> None:
    base = {"robots": {"astro": {"drive": {"type": "trapezoidal", "acceleration": 0.2}}}}

    def drive(*overrides: str) -> Any:
        return compose(base, overrides).data["robots"]["astro"]["drive"]

    assert {"type": "holonomic"} == drive("robots.astro.drive=holonomic")
    assert {"type": "holonomic"} == drive("robots.astro.drive.type=holonomic")
    assert {"type": "trapezoidal", "acceleration": 1} == drive("robots.astro.drive.acceleration=1")


def test_an_unknown_drive_is_refused_with_the_names_of_all() -> None:
    with pytest.raises(ScenarioError) as caught:
        fleet2d.load_scenario(None, "robots.astro.drive=holonomc")
    assert "did you mean 'holonomic'" in str(caught.value)


def test_people_have_no_drive() -> None:
    with pytest.raises(ScenarioError) as caught:
        fleet2d.load_scenario(None, "users.ana.drive=holonomic")
    assert "drive" in str(caught.value)
