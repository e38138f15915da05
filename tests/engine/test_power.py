"""Power: robots that are switched off, crash, update or run empty, and what they know afterwards."""

import copy
import random

import numpy as np
import pytest
from tests.entities.robots.test_interact import Scripted
from tests.scenes import (
    AGENDA,
    digests,
    entries,
    everything,
    expecting,
    path,
    run,
    scenario,
    table,
    unmet,
)
from tests.thorough import some

import fleet2d
from fleet2d import Algorithm
from fleet2d.engine.conversations import Conversations
from fleet2d.engine.repeat import reproduce, resume
from fleet2d.entities.plan import data_of
from fleet2d.errors import ScenarioError
from fleet2d.interventions import Decide

PATROL = {"type": "patrol", "dwell": "10 s"}
STAYS = {"type": "patrol", "waypoints": [[7.0, 1.0]], "dwell": "1 d"}
CAMERA = {"range": [0.3, 5], "angle_deg": 200}
BATTERY = {"driving": "20 min", "standing": "2 h", "charging": "1 h", "charger": [1.0, 3.0]}
PILL = {"do": "remind", "to": "ana", "at": ["07:10"], "within": "3 h", "worth": 4, "takes": "2 min"}
READS = [{"on": "daily", "items": [{"at": "00:10", "place": "kitchen", "activity": "read"}]}]
LEARNERS = {
    "ltp": {"type": "long_term_presence", "period": "5 min"},
    "rtp": {"type": "real_time_presence", "period": "5 min"},
}


def home(script="", duration="1 h", days=AGENDA, **changes):
    robot = {"camera": CAMERA, "behaviors": [PATROL], **changes.pop("astro", {})}
    return scenario(
        duration,
        users={"ana": {"type": "schedule", "days": days, "rest": "living_room"}},
        robots={"astro": robot, **changes.pop("robots", {})},
        script=entries(script),
        **changes,
    )


def events(stored, *kinds, entity="astro"):
    """Events as texts: step, kind, detail."""
    rows = table(stored, "events", entity=entity)
    columns = (rows["step"], rows["event"], rows["detail"])
    found = list(zip(*columns, strict=True))
    return [f"{step} {kind} {detail}".strip() for step, kind, detail in found if kind in kinds]


def steps(texts):
    return [int(text.split()[0]) for text in texts]


POWER = ("power_off", "power_on", "localization_lost", "relocalized")


def same_for_every_span(content, *spans):
    whole = run(content)
    for span in spans or (1, 37):
        assert digests(whole) == digests(run(content, f"simulation.max_span={span}")), span
    return whole


FORGETS = {"power": {"persists": ["map"]}, "localization": {"drift": "1 cm"}}
OUTAGES = {
    "for a while": (
        "at: 187 s, power: astro, duration: 10 min",
        {},
        ["187 power_off off", "787 power_on off"],
    ),
    "for good": ("at: 187 s, power: astro", {}, ["187 power_off off"]),
    "a crash": (
        "at: 187 s, power: astro, state: crash",
        {},
        ["187 power_off crash", "247 power_on crash"],
    ),
    "an update": (
        "at: 187 s, power: astro, state: update",
        {},
        ["187 power_off update", "1087 power_on update"],
    ),
    "for two reasons at once it is on when both are over": (
        """
        at: 5 min, power: astro, duration: 10 min
        at: 10 min, power: astro, state: update, duration: 20 min
        """,
        {},
        ["300 power_off off", "1800 power_on update"],
    ),
    "until it is restored": (
        """
        at: 5 min, power: astro
        at: 20 min, restore: astro
        """,
        {},
        ["300 power_off off", "1200 power_on off"],
    ),
    "on already": ("at: 5 min, power: astro, state: on", {}, []),
    "a crash while it is off": (
        """
        at: 5 min, power: astro
        at: 6 min, power: astro, state: crash
        at: 20 min, power: astro, state: on
        """,
        {},
        ["300 power_off off", "1200 power_on off"],
    ),
    "the first crash, which somebody ends early, doesn't end the second one": (
        """
        at: 300 s, power: astro, state: crash
        at: 330 s, power: astro, state: on
        at: 340 s, power: astro, state: crash
        """,
        {},
        ["300 power_off crash", "330 power_on crash", "340 power_off crash", "400 power_on crash"],
    ),
    "at the first step": (
        "at: 0 s, power: astro, duration: 1 min",
        {},
        ["0 power_off off", "60 power_on off"],
    ),
    "switched on as it goes off": (
        """
        on: [power_off, astro], delay: 30 s, power: astro, state: on
        at: 5 min, power: astro
        """,
        {},
        ["300 power_off off", "330 power_on off"],
    ),
    "without its place it is lost at first": (
        "at: 5 min, power: astro, duration: 5 min",
        FORGETS,
        ["300 power_off off", "600 power_on off", "601 localization_lost", "661 relocalized"],
    ),
    "it relocalizes by sight": (
        "at: 5 min, power: astro, duration: 5 min",
        FORGETS | {"localization": {"drift": "1 cm", "relocalizes": "20 s"}},
        ["300 power_off off", "600 power_on off", "601 localization_lost", "621 relocalized"],
    ),
}
OFF = expecting(
    """
    never(holds_for(power(astro) != on, 2 s) and moving(astro))
    never(power(astro) != on and perceived(ana, by=astro))
    eventually(moving(astro))
    """
)


@pytest.fixture(scope="module")
def life():
    """Where Ana is while nothing happens to the robot."""
    return path(run(home(duration="35 min")), "ana").x


@pytest.mark.parametrize("name", OUTAGES)
def test_a_robot_that_is_off_neither_moves_nor_sees_until_it_is_on_again(name, life):
    script, astro, expected = OUTAGES[name]
    stored = same_for_every_span(home(script, "35 min", astro=astro, expect=OFF))

    assert expected == events(stored, *POWER)
    assert [] == unmet(stored)
    assert np.array_equal(life, path(stored, "ana").x)


WATCHES = {"camera": {**CAMERA, "angle_deg": 360, "latency": "3 s"}, "behaviors": [STAYS]}
DOOR = {"door": {"type": "door", "doorway": "kitchen_1-living_room_1", "open": True}}
CASES = {
    "who is in view is lost at once": (
        "at: 15 min, power: astro, duration: 2 min",
        {"days": READS, "astro": WATCHES},
        """
        always(implies(during(07:10-07:15), seen(ana, by=astro)))
        never(during(07:15-07:17) and (seen(ana, by=astro) or perceived(ana, by=astro)))
        eventually(during(07:17-07:18) and seen(ana, by=astro))
        """,
    ),
    "an empty robot goes on as its charge is set": (
        "at: 1 h, battery: astro, charge: 50 %",
        {"astro": {"battery": BATTERY}, "duration": "65 min"},
        """
        always(implies(during(07:50-08:00), power(astro) == empty))
        eventually(during(08:00-08:02) and moving(astro))
        """,
    ),
    "an empty robot is not switched on": (
        "at: 1 h, power: astro, state: on",
        {"astro": {"battery": BATTERY}, "duration": "65 min"},
        "always(implies(during(07:50-08:05), power(astro) == empty))",
    ),
    "the charge does not fall while it is off": (
        "at: 5 min, power: astro, duration: 30 min",
        {"astro": {"battery": BATTERY}},
        """
        always(battery(astro) > 73 %, within=5..35 min)
        eventually(battery(astro) < 60 %)
        """,
    ),
    "it hears no calls": (
        """
        at: 5 min, power: astro, duration: 5 min
        at: 6 min, call: astro, to: kitchen
        """,
        {"astro": {"behaviors": [{"type": "come"}, PATROL]}},
        "never(events(called, astro))",
    ),
    "its state says why it is off": (
        """
        at: 5 min, power: astro, state: update, duration: 10 min
        at: 25 min, power: astro, duration: 10 min
        """,
        {},
        """
        share(power(astro) == update, of=during(07:00-07:20)) == 50 %
        after(during(07:25-07:26), always(power(astro) == off, within=9 min))
        """,
    ),
    "a door waits for one that is empty in it, and it goes on afterwards": (
        """
        at: 2 min, put: astro, to: [5.05, 3.1]
        at: 2 min, battery: astro, charge: 0
        at: 5 min, shut: door
        at: 20 min, put: astro, to: [1.0, 3.0]
        """,
        {"astro": {"battery": BATTERY}, "objects": DOOR},
        """
        always(implies(during(07:00-07:20), door(door)))
        eventually(not door(door))
        eventually(events(power_on, astro))
        """,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_what_an_outage_means(name):
    script, changes, expected = CASES[name]
    content = home(script, **changes, expect=expecting(expected))
    assert [] == unmet(same_for_every_span(content))


def test_an_empty_battery_switches_it_off_and_the_charger_on_again():
    """Somebody carries it to its charger: it is on again with 5 %, and lost for a minute."""
    put = "at: 1 h, put: astro, to: [1.0, 3.0]"
    content = home(put, "65 min", astro={"battery": BATTERY}, metrics={"uptime": {}})
    stored = same_for_every_span(content)
    told = events(stored, *POWER)
    off, on, _, _ = steps(told)

    assert 0.05 * 3600 == pytest.approx(on - 3600, abs=2)
    assert [
        f"{off} power_off empty",
        f"{on} power_on empty",
        f"{on + 1} localization_lost",
        f"{on + 61} relocalized",
    ] == told
    never = dict.fromkeys(("off", "crash", "update"), 0)
    uptime = {"on": 1 - (on - off) / 3900, "longest": on - off, "empty": 86400 / 3900, **never}
    assert uptime == pytest.approx(stored.metrics["uptime"]["astro"])


@pytest.mark.parametrize(
    ("persists", "keeps"), [(None, True), (["ltp", "place"], True), (["place"], False)]
)
def test_what_it_has_learned_outlasts_its_time_off_if_it_persists(persists, keeps):
    power = "at: 25 min, power: astro, duration: 10 min"
    content = home(power, algorithms=LEARNERS, astro={"power": {"persists": persists}})
    stored = same_for_every_span(content, 1)
    rows = table(stored, "ltp", user="anyone")
    before, after = (rows["share"][rows["step"] == step] for step in (1499, 2399))
    whole = table(run(home(algorithms=LEARNERS)), "ltp", user="anyone")

    assert np.array_equal(before, whole["share"][whole["step"] == 1499])
    assert (np.abs(after - before).max() < 0.2) == keeps


@pytest.mark.parametrize("model", ["hmm", "last_seen", "learned", "semi_markov"])
def test_real_time_presence_begins_anew_after_a_time_off(model):
    """What was seen in the same period before the crash is forgotten, too."""
    shares = []
    for state in ("crash", "on"):
        content = home(
            f"""
            at: 13 min, power: astro, state: {state}
            at: 14 min, put: astro, to: bathroom
            at: 14 min, hold: astro
            """,
            days=READS,
            algorithms={"rtp": {"type": "real_time_presence", "model": model}},
            metrics={"rtp_score": {"of": "rtp", "period": "5 min"}},
            astro={"camera": {"range": [0.3, 5], "angle_deg": 360}, "behaviors": [STAYS]},
        )
        rows = table(run(content), "rtp", user="ana", room="kitchen_1")
        shares.append(dict(zip(rows["step"].tolist(), rows["share"].tolist(), strict=True)))
    crashed, whole = shares

    assert crashed[599] == whole[599] > 0.9
    assert crashed[899] < 0.55
    assert whole[899] > 0.85


def test_several_robots_lose_what_they_know_only_when_none_is_on():
    off = "at: 13 min, power: astro, duration: 5 min"
    bolt = {"bolt": {"camera": CAMERA, "behaviors": [PATROL]}}
    known_from = []
    for script in (off, f"{off}\n{off.replace('astro', 'bolt')}"):
        simulation = fleet2d.Simulation(home(script, robots=bolt, algorithms=LEARNERS))
        simulation.run()
        known_from.append([each.known_from for each in simulation._state.learners.all])

    assert [[0, 0], [0, 1080]] == known_from


def test_the_map_is_lost_unless_it_persists():
    shares = []
    for persists in (["place"], ["place", "map"]):
        content = home(
            "at: 2400 s, power: astro, duration: 1170 s",
            astro={"power": {"persists": persists}},
        )
        content["floorplan"]["layers"] = {"explored": {}}
        simulation = fleet2d.Simulation(content)
        simulation.run()
        shares.append(float(simulation.home.layers["explored.astro"].values.mean()))

    assert shares[0] < shares[1]


def test_carried_while_off_it_believes_to_be_where_it_went_off():
    script = """
        at: 5 min, power: astro, duration: 5 min
        at: 7 min, put: astro, to: bathroom
    """
    simulation = fleet2d.Simulation(home(script, astro={"localization": {"left": "1 cm"}}))
    simulation.run_until("07:05")
    before = simulation.state["astro"]
    simulation.run_until("07:12")
    (off,) = simulation.actors["astro"].displacements
    after = path(simulation.run(), "astro")
    units = simulation.home.plan.lattice.units_per_m

    assert (600, 661) == (off.first, off.end), "until it is relocalized"
    moved = (before["x"] - after.x[600], before["y"] - after.y[600])
    assert (off.x / units, off.y / units) == pytest.approx(moved, abs=1e-6)


def test_crashes_come_from_the_robots_own_stream():
    power = {"crashes": {"per_day": 12, "lasts": "2 min"}}
    stored = same_for_every_span(home(duration="1 d", astro={"power": power}), 5000)
    other = run(home(duration="1 d", astro={"power": power}, robots={"bolt": {"type": "patrol"}}))

    assert 5 <= len(events(stored, "power_off")) <= 12
    assert events(stored, *POWER) == events(other, *POWER)
    another = run(home(duration="1 d", astro={"power": power}), "simulation.seed=5")
    assert events(stored, *POWER) != events(another, *POWER)


def test_updates_are_at_night_and_so_many_days_apart():
    power = {"updates": {"during": "02:00-04:00", "lasts": "10 min", "every": "2 d"}}
    stored = run(home(duration="4 d", astro={"power": power}, metrics={"uptime": {}}))
    hours = [step / 3600 + 7 for step in steps(events(stored, "power_off"))]

    assert [1, 3] == [hour // 24 for hour in hours]
    assert all(2 <= hour % 24 < 4 - 1 / 6 for hour in hours)
    assert 1 - 20 / (4 * 1440) == pytest.approx(stored.metrics["uptime"]["astro"]["on"])


def test_without_power_of_its_own_the_streams_of_a_run_are_as_before():
    assert digests(run(home())) == digests(run(home(astro={"power": {"persists": ["map"]}})))


def test_a_search_that_was_cut_off_begins_again():
    script = """
        on: [find_begins, astro], delay: 3 s, power: astro, state: crash
        at: 0 s, hold: ana
    """
    find = {"type": "find", "user": "ana", "every": "20 min"}
    stored = run(home(script, astro={"start": "kitchen", "behaviors": [find]}))
    happened = events(stored, "find_begins", "found", "power_off", "power_on")

    kinds = ["find_begins", "power_off", "power_on", "find_begins", "found"]
    assert kinds == [text.split()[1] for text in happened[:5]]


def test_behaviors_that_hold_much_of_the_run_begin_anew():
    """They were copied with all that they referred to, as far as what no run can copy."""
    crash = {"at": "2 h", "power": "astro", "state": "crash"}
    content = {"extends": "bundled:paper", "simulation": {"duration": "3 h"}, "script": [crash]}

    assert [7200, 7260] == steps(events(run(content), *POWER))


def test_a_changed_behavior_keeps_its_keys_when_it_begins_anew():
    script = """
        at: 2 min, configure: astro, behavior: patrol, keys: {rooms: [kitchen]}
        at: 5 min, power: astro, state: crash
    """
    simulation = fleet2d.Simulation(home(script))
    simulation.run()

    assert (("kitchen",),) == tuple(simulation.actors["astro"].behaviors[0].rooms)


def reminded(script, **pill):
    asks = {"behaviors": [{"type": "interact"}, PATROL]}
    content = home(script, "2 h", READS, astro=asks, interactions={"pill": {**PILL, **pill}})
    content["users"]["ana"]["answers"] = Scripted(outcomes=("accepted",))
    return content


def off_after(event, lasts="20 min"):
    return f"on: [{event}, astro], delay: 1 s, power: astro, duration: {lasts}"


@pytest.mark.parametrize(("event", "expected"), [("asks", ""), ("accepted", "accepted ")])
def test_power_that_is_lost_in_an_interaction_breaks_it_off_and_it_is_made_again(event, expected):
    stored = same_for_every_span(reminded(off_after(event)))
    kinds = ("asks", "accepted", "broken_off", "power_off", "power_on", "delivered")
    told = " ".join(text.split()[1] for text in events(stored, *kinds))

    assert told.startswith(f"asks {expected}power_off broken_off power_on asks ")
    assert 1 == told.count("broken_off")
    assert told.endswith("delivered"), "carried out"


@pytest.mark.parametrize("period", ["1 h", "10 min 10 s"])
def test_what_was_broken_off_counts_once_when_it_is_carried_out(period):
    """The second period ends between the question and the moment when power is lost."""
    content = reminded(off_after("accepted"))
    content["metrics"] = {"interactions": {"period": period}, "timing_regret": {"period": period}}
    stored = run(content)
    numbers = stored.metrics["interactions"]["astro"]["ana"]

    assert {"asked": 2, "kept": 1.0, "broken_off": 1, "accepted": 1.0}.items() <= numbers.items()
    assert 4.0 == numbers["value"]


def test_what_was_accepted_too_late_is_not_made_again():
    stored = run(reminded(off_after("accepted", "1 h"), within="20 min"))

    assert [] == events(stored, "delivered")
    assert 1 == len(events(stored, "asks"))


def test_a_person_trusts_less_after_a_robot_went_off_in_the_middle():
    simulation = fleet2d.Simulation(reminded(off_after("asks")))
    simulation.run_until(event="broken_off", entity="astro", timeout="1 h")
    conversations = simulation._state.find(Conversations)
    assert 0.525 * 0.97 == pytest.approx(conversations.attitudes[0, 1].trust)


def test_a_stored_run_is_reproduced_and_an_interrupted_one_resumed(tmp_path):
    power = {"crashes": {"per_day": 90, "lasts": "2 min"}, "persists": ["ltp"]}
    content = home(
        "at: 90 min, power: astro, duration: 10 min",
        "3 h",
        astro={"power": power},
        algorithms=LEARNERS,
    )
    stored = fleet2d.run(content, out=tmp_path / "run")
    assert {"off", "crash"} == {text.split()[2] for text in events(stored, "power_off")}
    assert reproduce(tmp_path / "run").same
    simulation, interrupted = (
        fleet2d.Simulation(content, out=out) for out in (None, tmp_path / "cut")
    )
    for each in (simulation, interrupted):
        each.advance(5405)  # it is off
    interrupted.finish()
    copied = copy.deepcopy(simulation)
    ends = (copied.run(), simulation.run(), resume(tmp_path / "cut"))
    assert {stored.digest} == {each.digest for each in ends}


class Watched(Algorithm):
    """How much was in view in each minute."""

    needs = frozenset({"evidence"})

    def update(self, history, state):
        return {"watched": history.evidence.watched.sum(axis=1)}


def test_nothing_counts_as_watched_while_it_is_off():
    algorithms = {"watched": {"type": "tests.engine.test_power:Watched", "period": "10 min"}}
    content = home("at: 5 min, power: astro, duration: 20 min", algorithms=algorithms)
    watched = table(same_for_every_span(content, 1), "watched")["watched"]

    assert 60 == len(watched)
    assert (watched[:5] > 0).all()
    assert 0 == watched[5:25].max()
    assert (watched[25:] > 0).all()


def test_a_robot_that_is_driven_from_outside_follows_no_plan_while_it_is_off():
    simulation = fleet2d.Simulation(home(duration="20 min"))
    simulation.do({"drive": "astro"})
    simulation.do({"at": "07:05", "power": "astro", "duration": "5 min"})
    rooms = []
    for decides, looks in (("07:06", "07:09"), ("07:11", "07:15")):
        simulation.run_until(decides)
        simulation.do(Decide("astro", data_of(simulation.plan("astro").go_to("kitchen").stay())))
        simulation.run_until(looks)
        rooms.append(simulation.state["astro"]["room"])
        assert ("off" in simulation.state["astro"]) == (looks == "07:09")
    assert "kitchen_1" == rooms[1] != rooms[0]


@pytest.mark.parametrize("at", ["2026-01-05T07:10", ["10 min"]])
def test_a_camera_fails_for_a_while(at):
    fails = {"at": at, "lasts": "10 min"}
    cameras = {"front": {**CAMERA, "fails": fails}, "back": {**CAMERA, "heading_deg": 180}}
    content = home(astro={"camera": None, "cameras": cameras})
    seen = table(same_for_every_span(content, 1), "observations")
    is_front = seen["camera"] == "front"
    dark = (seen["step"] >= 600) & (seen["step"] < 1200)

    assert not (is_front & dark).any()
    assert (is_front & ~dark).any()
    assert (~is_front & dark).any()


def test_a_sensor_fails_at_random():
    fails = {"per_day": 40, "lasts": "10 min"}
    sensor = {"type": "motion_sensor", "at": [6.5, 3.9], "heading_deg": -90, "range": "5 m"}
    content = home(duration="6 h", objects={"motion": {**sensor, "fails": fails}})
    acts = same_for_every_span(content, 1000).manifest["interventions"]

    assert 3 <= len(acts) <= 25
    assert {("stick", "objects.motion.fails")} == {(act["do"], act["by"]) for act in acts}


@pytest.mark.parametrize(
    ("script", "changes", "words"),
    [
        ("", {"power": {"persists": ["lpt"]}}, "did you mean 'ltp'"),
        ("", {"power": {"crashes": {"lasts": "1 min"}}}, "it never fails"),
        ("", {"power": {"crashes": {"at": "3 d"}}}, "not within the run"),
        ("", {"power": {"updates": {"during": "02:00-02:10"}}}, "shorter than an update"),
        ("", {"power": {"updates": {"during": "02:00-04:00", "every": "36 h"}}}, "whole days"),
        ("at: 5 min, power: astro, state: on, duration: 5 s", {}, "how long it is off"),
        ("at: 5 min, power: astro, ends: crash", {}, "goes with 'state: on'"),
        ("at: 5 min, power: astro, state: empty", {}, "no battery"),
        ("at: 5 min, power: ana", {}, "there is no robot 'ana'"),
        ("", {"camera": {"fails": {"per_day": 1}}, "perceives": "live"}, "'perceives' or 'fails'"),
    ],
)
def test_wrong_settings_are_refused(script, changes, words):
    with pytest.raises(ScenarioError, match=words):
        fleet2d.Simulation(home(script, astro=changes, algorithms=LEARNERS))


def test_a_state_that_power_never_has_is_refused():
    with pytest.raises(ScenarioError, match="did you mean 'update'"):
        fleet2d.Simulation(home(expect={"it": "never(power(astro) == updat)"}))


# All at random

ACTS = """
power: {who}, duration: {lasts} s
power: {who}
power: {who}, state: crash
power: {who}, state: update
power: {who}, state: on
put: {who}, to: [1.0, 3.0]
restore: {who}
kidnap: {who}, to: bathroom
fault: {who}, lost: true, duration: 4 min
send: {who}, to: kitchen
release: {who}
replan: {who}
"""


@pytest.mark.slow
@pytest.mark.parametrize("seed", some(range(40), 8))
def test_robots_that_go_off_and_on_at_any_time_have_the_same_run_for_every_span(seed):
    chance = random.Random(seed)
    content = everything("1 h")
    for robot in content["robots"].values():
        if chance.random() < 0.5:
            driving, charge = chance.randint(3, 30), chance.choice([0.2, 0.5, 1])
            robot["battery"] = {**BATTERY, "driving": f"{driving} min", "charge": charge}
        crashes = {"per_day": chance.choice([10, 100]), "lasts": f"{chance.randint(1, 400)} s"}
        persists = chance.choice([None, ["place"], ["map", "share"], []])
        robot["power"] = {"crashes": crashes, "persists": persists}
        if robot.get("camera"):
            fails = {"per_day": 50, "lasts": "3 min"}
            robot["camera"] = {**robot["camera"], "fails": fails, "latency": "2 s"}
    acts = ACTS.strip().splitlines()
    for _ in range(12):
        who = chance.choice(list(content["robots"]))
        act = chance.choice(acts).format(who=who, lasts=chance.randint(1, 900))
        content.setdefault("script", []).extend(entries(f"at: {chance.randint(0, 3599)} s, {act}"))
    stored = same_for_every_span(content, 1, chance.randint(2, 500))

    assert "complete" == stored.status
