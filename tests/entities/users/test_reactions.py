"""Reactions: what people do about robots, and that nothing happens where nobody asked for them."""

import copy

import numpy as np
import pytest
from tests.scenes import OWN, digests, path, run, scenario, table
from tests.thorough import THOROUGH

import fleet2d
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import InputError
from fleet2d.routines.persona import bundled_persona

NEVER = {"turns": 0, "steps_aside": 0, "leaves": 0, "comes": 0}
HERE = [6.5, 2.0]  # in the kitchen
FAR_OFF = [2.0, 5.5]  # in the bedroom


def meets(script, duration="5 min", at=HERE, **manners):
    """Ana stands still in the kitchen; a robot follows a script."""
    reactions = {"type": "reactions", "manners": {**NEVER, **manners}}
    ana = {"start": at, "start_heading_deg": 0, "behaviors": [reactions]}
    astro = {"type": f"{OWN}:Scripted", "script": script, "start": FAR_OFF, "camera": None}
    return scenario(duration, users={"ana": ana}, robots={"astro": astro})


def reacts(stored):
    return table(stored, "events", entity="ana", event="reacts")["detail"].tolist()


def apart(stored):
    ana, astro = path(stored, "ana"), path(stored, "astro")
    return np.sqrt((ana.x - astro.x) ** 2 + (ana.y - astro.y) ** 2)


def test_who_notices_a_robot_turns_to_it_once_and_looks():
    stored = run(meets([[5.5, 2.0], 200], turns=1, looks="20 s"))
    assert ["turns to astro"] == reacts(stored)
    ana, astro = path(stored, "ana"), path(stored, "astro")
    step = int(table(stored, "events", event="reacts")["step"][0]) - 1
    assert apart(stored)[step] <= 2.5 < apart(stored)[step - 1]
    to_it = np.arctan2(astro.y[step] - ana.y[step], astro.x[step] - ana.x[step])
    assert abs((ana.heading[step + 5] - to_it + np.pi) % (2 * np.pi) - np.pi) < 0.01


def test_a_robot_behind_a_wall_is_not_noticed():
    # 1.5 m apart, in the bedroom and the bathroom
    stored = run(meets([[3.4, 5.6], 100], at=[4.8, 5.6], turns=1))
    assert apart(stored).min() < 2.0
    assert [] == reacts(stored)


def test_a_robot_that_comes_again_is_noticed_again():
    stored = run(meets([[5.5, 2.0], 5, FAR_OFF, [5.5, 2.0], 60], turns=1, looks="2 s"))
    assert ["turns to astro"] * 2 == reacts(stored)


def test_who_is_in_the_way_steps_aside():
    stored = run(meets([[7.5, 2.0], 60], steps_aside=1))
    assert ["steps aside for astro"] == reacts(stored)
    ana = path(stored, "ana")
    assert 0.7 == pytest.approx(np.hypot(ana.x[-1] - HERE[0], ana.y[-1] - HERE[1]), abs=0.02)


def test_who_has_a_robot_too_close_leaves_when_patience_is_over():
    stored = run(meets([[6.0, 2.0], 250], leaves=1, patience="40 s"))
    assert ["leaves astro"] == reacts(stored)
    close = np.flatnonzero(apart(stored) <= 0.7)
    step = int(table(stored, "events", event="reacts")["step"][0])
    assert close[0] + 40 == step
    ana = path(stored, "ana")
    assert ana.room[step - 1] != ana.room[-1]


def test_a_robot_that_goes_on_in_time_is_put_up_with():
    stored = run(meets([[6.0, 2.0], 30, FAR_OFF], leaves=1, patience="40 s"))
    assert [] == reacts(stored)


def test_who_is_called_comes_and_stays_a_while():
    stored = run(meets([10, "call", 200], comes=1, comes_for="30 s"))
    assert ["comes to astro"] == reacts(stored)
    assert 0.9 == pytest.approx(apart(stored).min(), abs=0.02)
    ana = path(stored, "ana")
    assert ana.room[-1] == path(stored, "astro").room[-1] != ana.room[0]


def test_a_call_at_the_end_of_a_plan_is_heard():
    stored = run(meets([30, "call"], comes=1))
    assert ["comes to astro"] == reacts(stored)


def test_out_of_hearing_nobody_comes():
    assert [] == reacts(run(meets([10, "call", 60], comes=1, hears=2.0)))


def test_who_comes_is_not_stopped_by_noticing_the_robot():
    stored = run(meets([10, "call", 200], comes=1, comes_for="1 min", turns=1))
    assert ["comes to astro"] == reacts(stored)


def family(**manners):
    """People of all kinds who react, in a furnished home with a robot on its rounds."""
    reactions = {"type": "reactions", "manners": manners} if manners else {"type": "reactions"}
    users = {
        "ana": {"behaviors": [reactions, {"type": "routine", "persona": "retired"}]},
        "ben": {"behaviors": [reactions, {"type": "population", "group": "at_home"}]},
        "cleo": {"behaviors": [reactions, {"type": "meander"}]},
    }
    robots = {
        "astro": {"type": "patrol", "dwell": "30 s"},
        "bolt": {"type": f"{OWN}:Scripted", "script": ["kitchen", 60, "call", 60, "call"]},
    }
    return {
        **scenario("50 min", users=users, robots=robots, simulation={"start": "2026-01-05T10:00"}),
        "floorplan": {"type": "bundled", "furnish": True},
    }


@pytest.mark.slow
def test_every_table_is_the_same_for_every_max_span():
    lively = family(turns=1, steps_aside=1, leaves=1, comes=1, stops=0.5, patience="5 s")
    stored = run(lively)
    details = table(stored, "events", event="reacts")["detail"]
    assert {"turns", "comes", "leaves", "steps"} == {detail.split()[0] for detail in details}
    for span in (1, 7) if THOROUGH else (7,):
        assert digests(stored) == digests(run(lively, max_span=span))


def test_who_never_reacts_lives_as_if_there_was_no_such_behavior():
    without = family()
    for user in without["users"].values():
        user["behaviors"] = user["behaviors"][1:]
    assert digests(run(without)) == digests(run(family(**NEVER)))


def test_a_run_can_branch_in_the_middle_of_a_reaction():
    content = family(turns=1, comes=1, looks="2 min")
    whole = run(content)
    step = int(table(whole, "events", event="reacts")["step"][0]) + 3
    simulation = Simulation(content)
    simulation.advance(step)
    twin = copy.deepcopy(simulation)
    assert whole.digest == simulation.run().digest == twin.run().digest


def test_after_a_reaction_one_goes_on_with_what_one_did():
    day = {"on": "daily", "wake": "07:00", "leisure": {"read": 1}}
    activity = {"needs": {}, "errands": {}, "days": {"any_day": day}}
    content = meets(["living_room", 200], turns=1, looks="20 s", notices=6)
    routine = {"type": "routine", "persona": activity}
    content["users"]["ana"]["behaviors"].append(routine)
    content["users"]["ana"]["start"] = "living_room"
    content["simulation"]["start"] = "2026-01-05T09:00"
    stored = run(content)
    assert ["turns to astro"] == reacts(stored)
    assert {"read"} == set(table(stored, "events", entity="ana", event="activity")["detail"])


def test_who_gives_up_what_it_did_rests():
    day = {"on": "daily", "wake": "07:00", "leisure": {"read": 1}}
    activity = {"needs": {}, "errands": {}, "days": {"any_day": day}}
    content = meets([30, "call", 200], comes=1, stops=1, comes_for="20 s")
    content["users"]["ana"]["behaviors"].append({"type": "routine", "persona": activity})
    content["users"]["ana"]["start"] = "living_room"
    content["simulation"]["start"] = "2026-01-05T09:00"
    details = table(run(content), "events", entity="ana", event="activity")["detail"].tolist()
    assert ["read", "rest"] == details


def test_manners_are_the_personas_unless_given():
    def manners_of(*behaviors):
        users = {"ana": {"behaviors": list(behaviors)}}
        return Simulation(scenario(users=users)).actors["ana"].behaviors[0].used_manners

    routine = {"type": "routine", "persona": "child"}
    assert bundled_persona("child").manners == manners_of("reactions", routine)
    assert 0.25 == manners_of({"type": "reactions", "manners": {"turns": 0.25}}, routine).turns
    household = {"members": {"ben": "retired", "ana": "child"}}
    assert bundled_persona("child").manners == manners_of(
        "reactions", {"type": "routine", "household": household}
    )


def test_what_are_no_manners_is_refused_in_plain_words():
    content = meets([], turns=1.5)
    with pytest.raises(InputError, match=r"users\.ana.*turns"):
        fleet2d.load_scenario(content)
