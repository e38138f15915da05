"""Twelve tests of a home robot, which QA engineers would otherwise do by hand.

    pytest examples/product_tests
    pytest examples/product_tests -k quiet --fleet2d-set 'robots.astro.behaviors.3.when=[]'

The second command makes the robot worse on purpose: worse.toml has such a change for each test,
with which the test fails.
"""

from fleet2d.expectations import (
    always,
    at_end,
    battery,
    distance,
    during,
    events,
    eventually,
    holds_for,
    moving,
    never,
    perceived,
    probability,
    room,
    seen,
    sensor,
)
from fleet2d.interventions import Away, Call, HoldStill, Put, Send, ShutDoor
from fleet2d.testing import Trial, trial

HOME = "home.yaml"


@trial(HOME, seeds=20, holds=0.8)
def test_finds_ana_within_four_minutes(trial: Trial) -> None:
    """Wherever she is sent, in at least 80 % of evenings."""
    trial.do(Send("ana", ["kitchen", "office", "bedroom_2", "living_room"][trial.seed % 4]))
    trial.run_until("17:10")
    trial.do(Call("astro", find="ana"))
    trial.expect(eventually(seen("ana", by="astro"), within="4 min"))


@trial(HOME, seeds=3)
def test_keeps_off_who_it_has_found(trial: Trial) -> None:
    """It finds Ana on the sofa, and stays more than 60 cm away."""
    trial.do(Put("ana", "sofa"))
    trial.do(HoldStill("ana"))
    trial.do(Call("astro", find="ana"))
    trial.expect(always(distance("astro", "ana") > 0.6), name="keeps off")
    trial.expect(eventually(distance("astro", "ana") < 2.0), name="comes near")


@trial(HOME)
def test_never_stands_in_a_doorway_for_long(trial: Trial) -> None:
    """On its rounds it stands in a doorway for at most a minute at a time."""
    for doorway in trial.home.plan.doorways:
        (x0, y0), (x1, y1) = doorway.start, doorway.end
        there = distance("astro", ((x0 + x1) / 2, (y0 + y1) / 2)) < 0.4
        trial.expect(never(holds_for(there, "1 min")), name=f"leaves {doorway.name} free")


@trial(HOME, "robots.astro.battery.charge=22 %", "simulation.duration=3 h")
def test_docks_before_it_is_empty(trial: Trial) -> None:
    """It begins with a nearly empty battery, and must charge in time."""
    trial.expect(always(battery("astro") > "10 %"), name="never empty")
    trial.expect(eventually(events("docks", "astro")), name="docks")


@trial(HOME)
def test_stays_out_of_the_bathroom_while_it_is_occupied(trial: Trial) -> None:
    """Ana bathes for two hours; the robot makes its rounds."""
    trial.do(Put("ana", "bathroom_2"))
    trial.do(HoldStill("ana"))
    trial.expect(never(room("astro") == "bathroom_2"))


@trial(
    HOME,
    "simulation.duration=10 d",
    "algorithms.ltp.period=6 h",
    "robots.astro.battery=null",
    "robots.astro.gives_way=null",
    "robots.astro.behaviors=[{type: patrol, cooldown: 3 h, dwell: 0 s}]",
)
def test_learns_the_bedroom_within_ten_days(trial: Trial) -> None:
    """People are in bed for a third of the day: the robot must have learned that."""
    trial.expect(at_end(probability("ltp", "bedroom_1", "ana") > 0.15))


@trial(HOME, seeds=3)
def test_finds_its_way_when_it_is_carried_off(trial: Trial) -> None:
    """It is carried to the office while it drives to the kitchen, and still comes."""
    trial.do(Call("astro", to="kitchen"))
    trial.advance(10)
    trial.do(Put("astro", "office"))
    trial.expect(eventually(room("astro") == "kitchen", within="3 min"))


@trial(HOME)
def test_comes_although_a_door_is_shut_on_its_way(trial: Trial) -> None:
    """The door of the hallway falls shut: it goes through the entryway instead."""
    trial.do(Put("astro", "hallway"))
    trial.do(Call("astro", to="kitchen"))
    trial.advance(2)
    trial.do(ShutDoor("hall_door"))
    trial.expect(eventually(room("astro") == "kitchen", within="3 min"))


@trial(HOME, seeds=5)
def test_takes_no_guest_for_ana(trial: Trial) -> None:
    """Ana is out, and Ben sits on the sofa: it must not mistake him for her."""
    trial.do(Away("ana"))
    trial.do(Put("ben", "sofa"))
    trial.do(HoldStill("ben"))
    trial.run_until("17:05")
    trial.do(Call("astro", find="ana"))
    trial.expect(never(perceived("ana", by="astro"), within="15 min"))


@trial(HOME)
def test_notices_who_comes_into_the_kitchen(trial: Trial) -> None:
    """The motion sensor says so within a minute."""
    trial.do(Send("ana", "kitchen"))
    trial.expect(eventually(sensor("kitchen_motion"), within="2 min"))


@trial(
    HOME,
    "robots.astro.perception={detection: {light: [[17, 1], [17.02, 0], [18, 0], [18.02, 1]]}}",
    seeds=3,
)
def test_finds_ana_after_an_hour_with_a_dark_camera(trial: Trial) -> None:
    """It notices nobody from five to six; called after that, it still finds her."""
    trial.expect(never(perceived("ana", by="astro") & during("17:05-17:55")), name="is dark")
    trial.run_until("18:05")
    trial.do(Call("astro", find="ana"))
    trial.expect(eventually(seen("ana", by="astro"), within="5 min"))


@trial(HOME, "simulation.start=2026-01-05T21:00", "simulation.duration=10 h")
def test_is_quiet_at_night(trial: Trial) -> None:
    """It moves in no step between half past ten and seven."""
    trial.expect(never(moving("astro") & during("22:30-07:00")))
