"""Power: robots that are switched off, crash, update or run empty, and what they know afterwards."""

import copy
import random

import numpy as np
import pytest
from tests.entities.robots.test_interact import Scripted
from tests.scenes import AGENDA, digests, everything, path, run, scenario, table
from tests.thorough import some

import fleet2d
from fleet2d import Algorithm
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


def home(*script, duration="1 h", **changes):
    robot = {"camera": CAMERA, "behaviors": [PATROL], **changes.pop("astro", {})}
    return scenario(
        duration,
        users={"ana": {"type": "schedule", "days": AGENDA, "rest": "living_room"}},
        robots={"astro": robot, **changes.pop("robots", {})},
        script=list(script),
        **changes,
    )


def events(stored, *kinds, entity="astro"):
    rows = table(stored, "events", entity=entity)
    columns = (rows["step"], rows["event"], rows["detail"])
    found = [(int(s), str(e), str(d)) for s, e, d in zip(*columns, strict=True)]
    return [event for event in found if event[1] in kinds]


POWER = ("power_off", "power_on")


def same_for_every_span(content, *spans):
    whole = run(content)
    for span in spans or (1, 37):
        assert digests(whole) == digests(run(content, f"simulation.max_span={span}")), span
    return whole


def is_off(stored, steps):
    """Whether astro is off at some steps."""
    ends = [step for step, *_ in events(stored, *POWER)]
    return np.searchsorted(ends, steps, side="right") % 2 == 1


@pytest.mark.parametrize(
    ("act", "reason", "lasts"),
    [
        ({"power": "astro", "duration": "10 min"}, "off", 600),
        ({"power": "astro", "state": "off"}, "off", None),
        ({"power": "astro", "state": "crash"}, "crash", 60),
        ({"power": "astro", "state": "update"}, "update", 900),
    ],
)
def test_a_robot_that_is_off_neither_moves_nor_sees_until_it_is_on_again(act, reason, lasts):
    stored = same_for_every_span(home({"at": "07:03:07", **act}, duration="25 min"), 37)
    expected = [(187, "power_off", reason)]
    if lasts is not None:
        expected.append((187 + lasts, "power_on", reason))

    assert expected == events(stored, *POWER)
    poses = path(stored, "astro")
    moves = np.flatnonzero(np.hypot(np.diff(poses.x), np.diff(poses.y)) > 0)
    assert not is_off(stored, moves).any()
    assert (moves < 187).any()
    assert (moves > 187 + (lasts or 4000)).any() == (lasts is not None)
    assert np.array_equal(path(run(home(duration="25 min")), "ana").x, path(stored, "ana").x)
    assert not is_off(stored, table(stored, "observations")["step"]).any()


@pytest.mark.parametrize(
    ("script", "times"),
    [
        # Two reasons at once: it is on when both are over.
        (
            [
                {"at": "07:05", "power": "astro", "duration": "10 min"},
                {"at": "07:10", "power": "astro", "state": "update", "duration": "20 min"},
            ],
            [300, 1800],
        ),
        ([{"at": "07:05", "power": "astro"}, {"at": "07:20", "restore": "astro"}], [300, 1200]),
        ([{"at": "07:05", "power": "astro", "state": "on"}], []),
        (
            [
                {"at": "07:05", "power": "astro"},
                {"at": "07:06", "power": "astro", "state": "crash"},
                {"at": "07:20", "power": "astro", "state": "on"},
            ],
            [300, 1200],
        ),
        # The first crash, which somebody ends early, doesn't end the second one.
        (
            [
                {"at": "07:05", "power": "astro", "state": "crash"},
                {"at": "07:05:30", "power": "astro", "state": "on"},
                {"at": "07:05:40", "power": "astro", "state": "crash"},
            ],
            [300, 330, 340, 400],
        ),
        # An outage at the first step.
        ([{"at": "0 s", "power": "astro", "duration": "1 min"}], [0, 60]),
        ([{"on": ["power_off", "astro"], "delay": "30 s", "power": "astro", "state": "on"}, {"at": "07:05", "power": "astro"}], [300, 330]),
    ],
)  # fmt: skip
def test_when_it_is_off(script, times):
    stored = run(home(*script, duration="35 min"))

    assert times == [step for step, *_ in events(stored, *POWER)]


def test_nobody_who_is_in_view_stays_in_view_of_a_robot_that_is_off():
    watches = {
        "camera": {"range": [0.3, 5], "angle_deg": 360, "latency": "3 s"},
        "behaviors": [STAYS],
    }
    content = home({"at": "07:15", "power": "astro", "duration": "2 min"}, astro=watches)
    content["users"]["ana"]["days"] = READS
    stored = same_for_every_span(content)
    lost = [step for step, *_ in events(stored, "user_lost")]
    seen = table(stored, "observations")["step"]

    assert 900 in lost, "at once"
    assert (seen[seen < 900] > 890).any()
    assert not ((seen >= 900) & (seen < 1020 + 3)).any()


def test_an_empty_battery_switches_it_off_and_the_charger_on_again():
    """Somebody carries it to its charger: it is on again with 5 %, and lost for a minute."""
    put = {"at": "08:00", "put": "astro", "to": BATTERY["charger"]}
    content = home(put, duration="65 min", astro={"battery": BATTERY}, metrics={"uptime": {}})
    stored = same_for_every_span(content)
    (off, *_), (on, *_) = events(stored, *POWER)

    assert [(off, "power_off", "empty"), (on, "power_on", "empty")] == events(stored, *POWER)
    assert 0.05 * 3600 == pytest.approx(on - 3600, abs=2)
    assert [(on + 1, "localization_lost", "")] == events(stored, "localization_lost")
    assert [(on + 61, "relocalized", "")] == events(stored, "relocalized")
    assert np.ptp(path(stored, "astro").x[on + 62 :]) > 0.3
    uptime = {"on": 1 - (on - off) / 3900, "longest": on - off, "empty": 86400 / 3900}
    assert uptime == pytest.approx(stored.metrics["uptime"]["astro"])


@pytest.mark.parametrize(
    ("act", "on"),
    [({"battery": "astro", "charge": "50 %"}, [3600]), ({"power": "astro", "state": "on"}, [])],
    ids=["charged", "switched on"],
)
def test_an_empty_robot_goes_on_when_it_is_charged_and_not_when_it_is_switched_on(act, on):
    content = home({"at": "08:00", **act}, duration="65 min", astro={"battery": BATTERY})
    stored = run(content)

    assert on == [step for step, *_ in events(stored, "power_on")]
    assert (np.ptp(path(stored, "astro").x[3601:3700]) > 1) == bool(on)


def test_the_charge_does_not_fall_while_it_is_off():
    simulation = fleet2d.Simulation(
        home({"at": "07:05", "power": "astro", "duration": "30 min"}, astro={"battery": BATTERY})
    )
    simulation.expect("always(battery(astro) > 73 %, within=5..35 min)", "keeps")
    simulation.expect("eventually(battery(astro) < 60 %)", "falls again")
    simulation.run()

    assert simulation.verdicts()["keeps"].holds
    assert simulation.verdicts()["falls again"].holds


@pytest.mark.parametrize(
    ("persists", "keeps"), [(None, True), (["ltp", "place"], True), (["place"], False)]
)
def test_what_it_has_learned_outlasts_its_time_off_if_it_persists(persists, keeps):
    power = {"at": "07:25", "power": "astro", "duration": "10 min"}
    content = home(power, algorithms=LEARNERS, astro={"power": {"persists": persists}})
    stored = run(content)
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
            {"at": "07:13", "power": "astro", "state": state},
            {"at": "07:14", "put": "astro", "to": "bathroom"},
            {"at": "07:14", "hold": "astro"},
            algorithms={"rtp": {"type": "real_time_presence", "model": model}},
            metrics={"rtp_score": {"of": "rtp", "period": "5 min"}},
            astro={"camera": {"range": [0.3, 5], "angle_deg": 360}, "behaviors": [STAYS]},
        )
        content["users"]["ana"]["days"] = READS
        rows = table(run(content), "rtp", user="ana", room="kitchen_1")
        shares.append(dict(zip(rows["step"].tolist(), rows["share"].tolist(), strict=True)))
    crashed, whole = shares

    assert crashed[599] == whole[599] > 0.9
    assert crashed[899] < 0.55
    assert whole[899] > 0.85


def test_several_robots_lose_what_they_know_only_when_none_is_on():
    off = {"at": "07:13", "power": "astro", "duration": "5 min"}
    bolt = {"bolt": {"camera": CAMERA, "behaviors": [PATROL]}}
    known_from = []
    for more in ((), ({**off, "power": "bolt"},)):
        simulation = fleet2d.Simulation(home(off, *more, robots=bolt, algorithms=LEARNERS))
        simulation.run()
        known_from.append([each.known_from for each in simulation._state.learners.all])

    assert [[0, 0], [0, 1080]] == known_from


def test_the_map_is_lost_unless_it_persists():
    layers = {"explored": {}}
    shares = []
    for persists in (["place"], ["place", "map"]):
        content = home(
            {"at": "07:40", "power": "astro"},
            {"at": "07:59:30", "power": "astro", "state": "on"},
            astro={"power": {"persists": persists}},
        )
        content["floorplan"]["layers"] = layers
        simulation = fleet2d.Simulation(content)
        simulation.run()
        shares.append(float(simulation.home.layers["explored.astro"].values.mean()))

    assert shares[0] < shares[1]


@pytest.mark.parametrize("relocalizes", [None, "20 s"])
def test_a_robot_that_keeps_no_place_is_lost_at_first(relocalizes):
    astro = {
        "power": {"persists": ["map"]},
        "localization": {"drift": "1 cm", "relocalizes": relocalizes},
    }
    stored = same_for_every_span(
        home({"at": "07:05", "power": "astro", "duration": "5 min"}, duration="12 min", astro=astro)
    )

    assert [601] == [step for step, *_ in events(stored, "localization_lost")]
    assert [621 if relocalizes else 661] == [step for step, *_ in events(stored, "relocalized")]


def test_carried_while_off_it_believes_to_be_where_it_went_off():
    script = [
        {"at": "07:05", "power": "astro", "duration": "5 min"},
        {"at": "07:07", "put": "astro", "to": "bathroom"},
    ]
    simulation = fleet2d.Simulation(home(*script, astro={"localization": {"left": "1 cm"}}))
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
    stored = run(home(duration="1 d", astro={"power": power}))
    other = run(home(duration="1 d", astro={"power": power}, robots={"bolt": {"type": "patrol"}}))

    assert 5 <= len(events(stored, "power_off")) <= 12
    assert {"crash"} == {detail for *_, detail in events(stored, *POWER)}
    assert events(stored, *POWER) == events(other, *POWER)


def test_updates_are_at_night_and_so_many_days_apart():
    power = {"updates": {"during": "02:00-04:00", "lasts": "10 min", "every": "2 d"}}
    stored = run(home(duration="4 d", astro={"power": power}, metrics={"uptime": {}}))
    hours = [(step + 7 * 3600) / 3600 for step, *_ in events(stored, "power_off")]

    assert [1, 3] == [hour // 24 for hour in hours]
    assert all(2 <= hour % 24 < 4 - 1 / 6 for hour in hours)
    assert 1 - 20 / (4 * 1440) == pytest.approx(stored.metrics["uptime"]["astro"]["on"])


def test_behaviors_that_hold_much_of_the_run_begin_anew():
    """They were copied with all that they referred to, as far as what no run can copy."""
    crash = {"at": "2 h", "power": "astro", "state": "crash"}
    content = {"extends": "bundled:paper", "simulation": {"duration": "3 h"}, "script": [crash]}

    assert [7200, 7260] == [step for step, *_ in events(run(content), *POWER)]


def test_a_changed_behavior_keeps_its_keys_when_it_begins_anew():
    keys = {"rooms": ["kitchen"]}
    script = [
        {"at": "07:02", "configure": "astro", "behavior": "patrol", "keys": keys},
        {"at": "07:05", "power": "astro", "state": "crash"},
    ]
    simulation = fleet2d.Simulation(home(*script))
    simulation.run()

    assert (("kitchen",),) == tuple(simulation.actors["astro"].behaviors[0].rooms)


# People


def reminded(script, **pill):
    users = {
        "ana": {"type": "schedule", "days": READS, "answers": Scripted(outcomes=("accepted",))}
    }
    content = home(*script, duration="2 h", interactions={"pill": {**PILL, **pill}})
    content["users"] = users
    content["robots"]["astro"]["behaviors"] = [{"type": "interact"}, PATROL]
    return content


@pytest.mark.parametrize("event", ["asks", "accepted"])
def test_power_that_is_lost_in_an_interaction_breaks_it_off_and_it_is_made_again(event):
    script = [{"on": [event, "astro"], "delay": "1 s", "power": "astro", "duration": "20 min"}]
    stored = same_for_every_span(reminded(script))
    kinds = [kind for _, kind, _ in events(stored, "asks", "accepted", "broken_off", "power_off", "power_on", "delivered")]  # fmt: skip
    before = ["asks"] if event == "asks" else ["asks", "accepted"]

    assert [*before, "power_off", "broken_off", "power_on", "asks"] == kinds[: len(before) + 4]
    assert 1 == kinds.count("broken_off")
    assert "delivered" == kinds[-1], "carried out"


@pytest.mark.parametrize("period", ["1 h", "10 min 10 s"])
def test_what_was_broken_off_counts_once_when_it_is_carried_out(period):
    """The second period ends between the question and the moment when power is lost."""
    script = [{"on": ["accepted", "astro"], "delay": "1 s", "power": "astro", "duration": "20 min"}]
    content = reminded(script)
    content["metrics"] = {"interactions": {"period": period}, "timing_regret": {"period": period}}
    stored = run(content)
    numbers = stored.metrics["interactions"]["astro"]["ana"]

    assert {"asked": 2, "kept": 1.0, "broken_off": 1, "accepted": 1.0}.items() <= numbers.items()
    assert 4.0 == numbers["value"]


def test_what_was_accepted_too_late_is_not_made_again():
    script = [{"on": ["accepted", "astro"], "delay": "1 s", "power": "astro", "duration": "1 h"}]
    stored = run(reminded(script, within="20 min"))

    assert [] == events(stored, "delivered")
    assert 1 == len(events(stored, "asks"))


def test_a_person_trusts_less_after_a_robot_went_off_in_the_middle():
    script = [{"on": ["asks", "astro"], "delay": "1 s", "power": "astro", "duration": "20 min"}]
    simulation = fleet2d.Simulation(reminded(script))
    simulation.run_until(event="broken_off", entity="astro", timeout="1 h")
    from fleet2d.engine.conversations import Conversations

    conversations = simulation._state.find(Conversations)
    assert conversations is not None
    assert 0.525 * 0.97 == pytest.approx(conversations.attitudes[0, 1].trust)


def test_a_robot_that_is_off_does_not_hear_calls():
    come = {"at": "07:06", "call": "astro", "to": "kitchen"}
    content = home({"at": "07:05", "power": "astro", "duration": "5 min"}, come)
    content["robots"]["astro"]["behaviors"] = [{"type": "come"}, PATROL]

    assert [] == events(run(content), "called")


# Doors, and runs


def test_a_battery_that_ends_in_a_doorway_hangs_nothing():
    """The door waits for the robot to be carried off, people go through, and it goes on afterwards."""
    script = [
        {"at": "07:02", "put": "astro", "to": [5.05, 3.1]},
        {"at": "07:02", "battery": "astro", "charge": 0},
        {"at": "07:05", "shut": "door"},
        {"at": "07:20", "put": "astro", "to": BATTERY["charger"]},
    ]  # fmt: skip
    content = home(
        *script,
        astro={"battery": BATTERY},
        objects={"door": {"type": "door", "doorway": "kitchen_1-living_room_1", "open": True}},
    )
    stored = same_for_every_span(content)

    assert 121 == events(stored, "power_off")[0][0]
    ((shut, *_),) = events(stored, "shut", entity="door")[:1]
    assert 1200 <= shut
    assert events(stored, "power_on")


def test_a_stored_run_is_reproduced_and_an_interrupted_one_resumed(tmp_path):
    power = {"crashes": {"per_day": 90, "lasts": "2 min"}, "persists": ["ltp"]}
    content = home(
        {"at": "08:30", "power": "astro", "duration": "10 min"},
        duration="3 h",
        astro={"power": power},
        algorithms=LEARNERS,
    )
    stored = fleet2d.run(content, out=tmp_path / "run")
    assert {"off", "crash"} == {reason for *_, reason in events(stored, "power_off")}
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
    content = home({"at": "07:05", "power": "astro", "duration": "20 min"}, algorithms=algorithms)
    watched = table(run(content), "watched")["watched"]

    assert 60 == len(watched)
    assert (watched[:5] > 0).all()
    assert 0 == watched[5:25].max()
    assert (watched[25:] > 0).all()


def test_a_test_can_expect_and_ask_why_it_is_off():
    script = [
        {"at": "07:05", "power": "astro", "state": "update", "duration": "10 min"},
        {"at": "07:25", "power": "astro", "duration": "10 min"},
    ]
    simulation = fleet2d.Simulation(home(*script))
    expected = {
        "still": "never(holds_for(power(astro) != on, 2 s) and moving(astro))",
        "updates": "share(power(astro) == update, of=during(07:00-07:20)) == 50 %",
        "off": "after(during(07:25-07:26), always(power(astro) == off, within=9 min))",
        "wrong": "always(power(astro) == on)",
    }
    for name, text in expected.items():
        simulation.expect(text, name)
    with pytest.raises(ScenarioError, match="did you mean 'update'"):
        simulation.expect("never(power(astro) == updat)")
    simulation.run_until("07:06")
    assert "update" == simulation.state["astro"]["off"]
    simulation.run_until("07:16")
    assert "off" not in simulation.state["astro"]
    assert "complete" == simulation.run().status

    holds = {name: verdict.holds for name, verdict in simulation.verdicts().items()}
    assert {"still": True, "updates": True, "off": True, "wrong": False} == holds


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
    assert "kitchen_1" == rooms[1] != rooms[0]


# Cameras and sensors


def test_a_camera_fails_for_a_while():
    fails = {"at": ["2026-01-05T07:10"], "lasts": "10 min"}
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
    ("changes", "words"),
    [
        ({"astro": {"power": {"persists": ["lpt"]}}, "algorithms": LEARNERS}, "did you mean 'ltp'"),
        ({"astro": {"power": {"crashes": {"lasts": "1 min"}}}}, "it never fails"),
        ({"astro": {"power": {"crashes": {"at": "3 d"}}}}, "not within the run"),
        ({"astro": {"power": {"updates": {"during": "02:00-02:10"}}}}, "shorter than an update"),
        (
            {"astro": {"power": {"updates": {"during": "02:00-04:00", "every": "36 h"}}}},
            "whole days",
        ),
        (
            {"script": [{"at": "07:05", "power": "astro", "state": "on", "duration": "5 s"}]},
            "how long it is off",
        ),
        ({"script": [{"at": "07:05", "power": "astro", "ends": "crash"}]}, "goes with 'state: on'"),
        ({"script": [{"at": "07:05", "power": "astro", "state": "empty"}]}, "no battery"),
        ({"script": [{"at": "07:05", "power": "ana"}]}, "there is no robot 'ana'"),
        (
            {"astro": {"camera": {"fails": {"per_day": 1}}, "perceives": "live"}},
            "'perceives' or 'fails'",
        ),
    ],
)
def test_wrong_settings_are_refused(changes, words):
    script = changes.pop("script", [])
    with pytest.raises(ScenarioError, match=words):
        fleet2d.Simulation(home(*script, **changes))


# All at random


@pytest.mark.slow
@pytest.mark.parametrize("seed", some(range(40), 8))
def test_robots_that_go_off_and_on_at_any_time_have_the_same_run_for_every_span(seed):
    chance = random.Random(seed)
    content = everything("1 h")
    for robot in content["robots"].values():
        if chance.random() < 0.5:
            charge = chance.choice([0.2, 0.5, 1])
            robot["battery"] = {
                **BATTERY,
                "driving": f"{chance.randint(3, 30)} min",
                "charge": charge,
            }
        crashes = {"per_day": chance.choice([10, 100]), "lasts": f"{chance.randint(1, 400)} s"}
        persists = chance.choice([None, ["place"], ["map", "share"], []])
        robot["power"] = {"crashes": crashes, "persists": persists}
        if robot.get("camera"):
            fails = {"per_day": 50, "lasts": "3 min"}
            robot["camera"] = {**robot["camera"], "fails": fails, "latency": "2 s"}
    content["script"] = []
    for _ in range(12):
        who = chance.choice(list(content["robots"]))
        more = chance.choice([
            {"power": who, "duration": f"{chance.randint(1, 900)} s"}, {"power": who},
            {"power": who, "state": "crash"}, {"power": who, "state": "update"},
            {"power": who, "state": "on"}, {"put": who, "to": [1.0, 3.0]}, {"restore": who},
            {"kidnap": who, "to": "bathroom"}, {"fault": who, "lost": True, "duration": "4 min"},
            {"send": who, "to": "kitchen"}, {"release": who}, {"replan": who},
        ])  # fmt: skip
        content["script"].append({"at": f"{chance.randint(0, 3599)} s", **more})
    stored = same_for_every_span(content, 1, chance.randint(2, 500))

    assert "complete" == stored.status
