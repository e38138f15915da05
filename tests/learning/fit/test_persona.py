"""Fitting: what is put into a log comes out of the persona, and days held back are matched."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from tests.thorough import THOROUGH, some

from fleet2d import cli
from fleet2d.configuration.documents import read_document
from fleet2d.learning.fit import validation
from fleet2d.learning.fit.command import fit_routine
from fleet2d.learning.fit.persona import fit_persona, gaps, to_yaml
from fleet2d.learning.fit.privacy import private_days, repeats
from fleet2d.learning.fit.timeline import (
    ActivityPlace,
    RoutineDistances,
    Timeline,
    by_hour,
    distances,
    dwell_times,
    find_days,
    ks_distance,
    read_timeline,
    shares,
    wasserstein,
)
from fleet2d.learning.fit.validation import (
    Validation,
    sample_markov,
    sample_persona,
    simulated_repeats,
    validate,
)
from fleet2d.logs.layout import read_log
from fleet2d.logs.log import LogError
from fleet2d.routines.persona import Persona, read_persona
from fleet2d.routines.planner import parse_day
from fleet2d.runtime.clock import DAY_MINUTES
from fleet2d.runtime.determinism import Draws, stream_key

FIRST = datetime(2020, 3, 2)  # a Monday
LOGS = ["homer_plus_a", "uci_adl_a", "casas_al/events_10_days.txt"]


def write_life(folder: Path, days=24, weekend=True) -> Path:
    """Write the log of a life that is known: UCI ADL activities of some days.

    Asleep 23:00 to 07:00 ± 10 min, out at 09:00 ± 5 min for 3 h on weekdays; else by turns an hour
    in the living room and ten minutes in the kitchen or the bathroom.
    """
    rows = []
    key = stream_key(1, "life", "days")

    def clock(day, minute):
        return f"{FIRST + timedelta(days=day, minutes=minute):%Y-%m-%d %H:%M:%S}"

    wake = [7 * 60 + Draws(key, day).below(21) - 10 for day in range(days + 1)]
    for day in range(days):
        draws = Draws(key, 1000 + day)
        now = wake[day]
        out = 9 * 60 + draws.below(11) - 5
        works = day % 7 < 5 or not weekend
        here = "Spare_Time/TV"
        while now < 23 * 60:
            if works and now <= out < now + 20:
                rows += [(day, now, out, "Spare_Time/TV"), (day, out, out + 180, "Leaving")]
                now, here = out + 180, "Spare_Time/TV"
                continue
            lasts = 60 if here == "Spare_Time/TV" else 10
            end = min(now + lasts, 23 * 60, out if works and now < out else 23 * 60)
            rows.append((day, now, end, here))
            other = draws.choice(["Breakfast", "Toileting"])
            now, here = end, other if here == "Spare_Time/TV" else "Spare_Time/TV"
        rows.append((day, 23 * 60, 24 * 60 + wake[day + 1], "Sleeping"))
    file = folder / "life_ADLs.txt"
    file.write_text(
        "".join(f"{clock(d, a)}\t{clock(d, b)}\t{what}\n" for d, a, b, what in rows if b > a)
    )
    return file


def timeline_of(path: Path) -> Timeline:
    return read_timeline(read_log(path))


@pytest.fixture(scope="module")
def life(tmp_path_factory):
    return timeline_of(write_life(tmp_path_factory.mktemp("life")))


def test_days_go_from_waking_to_bed(life):
    days = find_days(life)
    assert list(range(1, 23)) == [day.number for day in days][:22]
    assert all(7 * 60 - 11 <= day.wake <= 7 * 60 + 11 for day in days)
    assert {23 * 60} == {day.bed for day in days}


def test_a_known_life_is_kept_to(life):
    days = find_days(life)
    fitted = fit_persona(life, days)
    assert ["weekday", "weekend"] == list(fitted.persona.days)
    assert fitted.persona.activity("leaving").away
    rooms = sample_persona(fitted, life, 70)[1]
    away = life.places.index("away")
    morning = rooms[:, 10 * 60 + 30] == away
    weekdays = np.arange(70) % 7 < 5
    assert morning[weekdays].mean() > 0.95
    assert not morning[~weekdays].any()
    real = life.rooms[[day.number for day in days]]
    assert distances(real, rooms, len(life.places)).share < 0.03


def test_nights_away_are_lived_away():
    minutes = np.zeros((20, DAY_MINUTES), np.int16)  # days in the living room
    minutes[:, 23 * 60 :] = 1
    minutes[:, : 7 * 60] = 1
    for first in range(3, 20, 5):  # out from 18:00 to 18:00 two days later
        minutes[first : first + 3].ravel()[18 * 60 : 66 * 60] = 2
    labels = ("tv", "living_room"), ("sleep", "bedroom"), ("away", "away")
    states = tuple(ActivityPlace(*label) for label in labels)
    timeline = Timeline(states, minutes, minutes.repeat(60, axis=1), None)
    days = find_days(timeline)
    assert list(range(19)) == [day.number for day in days]  # the last ends out of the log
    fitted = fit_persona(timeline, days)
    away = sample_persona(fitted, timeline, 300)[1] == timeline.places.index("away")
    night = away[:, 2 * 60 : 5 * 60]
    assert (night.all(axis=1) | ~night.any(axis=1)).all()
    assert away.mean() == pytest.approx((minutes == 2).mean(), abs=0.08)


def test_the_written_persona_reads_back_as_the_fitted_one(life, tmp_path):
    fitted = fit_persona(life, find_days(life), "fitted to: a, b")
    file = tmp_path / "persona.yaml"
    file.write_text(to_yaml(fitted.document), encoding="utf-8")
    assert fitted.persona == Persona.model_validate(read_document(file).data)
    assert fitted.persona == Persona.model_validate(read_persona(str(file)))


def test_one_seed_samples_the_same_days_and_another_others(life):
    fitted = fit_persona(life, find_days(life))
    first, second, other = (sample_persona(fitted, life, 5, seed)[1] for seed in (1, 1, 2))
    assert (first == second).all()
    assert (first != other).any()


def test_a_markov_chain_keeps_the_shares_of_time(life):
    count = len(life.places)
    chain = sample_markov(life.rooms, count, 400)
    assert shares(life.rooms, count) == pytest.approx(shares(chain, count), abs=0.05)
    hours = by_hour(chain, count)
    assert np.abs(hours - hours.mean(axis=0)).max() < 0.12  # it knows no clock


@pytest.mark.slow
@pytest.mark.parametrize("name", some(LOGS, 3))
def test_days_of_real_logs_held_back_are_matched_as_well_as_by_copies(shared_data, name):
    persona, copies, chain, _ = validate(timeline_of(shared_data / "activity" / name)).rooms
    assert persona.ks < copies.ks + 0.005
    assert persona.hours < copies.hours + 0.005
    assert persona.stay_min < copies.stay_min + 0.5
    assert persona.hours < 0.55 * chain.hours
    assert persona.stay_min < 0.7 * chain.stay_min


def test_a_fitted_persona_lives_days_that_nobody_lived(life):
    days = find_days(life)
    sampled = sample_persona(fit_persona(life, days), life, 60)[1]
    lived = {row.tobytes() for row in life.rooms}
    assert sum(row.tobytes() not in lived for row in sampled) > 30


def test_the_report_names_what_is_worse_than_copying():
    near, far = RoutineDistances(0.1, 0.2, 0.1, 5, 0.1), RoutineDistances(0.1, 0.1, 0.2, 5, 0.1)
    models, equal = (near, far, near, near), (near, near, near, near)
    assert ["hours 0.200, copies 0.100"] == Validation(
        9, 3, models, models, equal
    ).worse_than_copying()
    assert ["hours to the second 0.200, copies 0.100"] == Validation(
        9, 3, equal, equal, models
    ).worse_than_copying()


def test_stays_of_seconds_are_lived_as_recorded(shared_data):
    """By minutes alone, a person of CASAS AL went for a moment to a room 24 instead of 38 times."""
    timeline = timeline_of(shared_data / "activity" / LOGS[2])
    days = find_days(timeline)
    count = len(timeline.places)
    lived = sample_persona(fit_persona(timeline, days), timeline, 14, to_second=True)[1]
    real = timeline.places_of(timeline.seconds[[day.number for day in days]])
    apart = distances(real, lived, count)
    assert apart.ks < 0.08
    assert apart.transitions < 0.06
    short_real, short_lived = (
        sum((stays < 3).sum() for stays in dwell_times(labels, count)) / len(labels)
        for labels in (real, lived)
    )
    assert short_real == pytest.approx(short_lived, rel=0.2)


# Privacy


def test_days_of_a_private_persona_are_none_of_the_log_and_repeat_little_of_it(life):
    days = find_days(life)
    plain, private = fit_persona(life, days), fit_persona(life, days, private=True)
    texts = {text for day in plain.document["days"].values() for text in day["recorded"]}
    entries = {entry for text in texts for entry in text.split(", ")}
    for day in private.document["days"].values():
        for text in day["recorded"]:
            assert text not in texts
            shared = [entry in entries for entry in text.split(", ")]
            assert sum(shared) < len(shared) / 2  # by chance
    among_each_other = repeats(plain.log, plain.log)
    assert simulated_repeats(plain, 28).longest > among_each_other.longest
    assert simulated_repeats(private, 28).mean <= among_each_other.mean
    assert not any("takes" in fields for fields in private.document["activities"].values())


def test_what_was_done_on_one_day_only_is_not_in_a_private_persona():
    usual = "07:00 wash, 07:20 tv, 23:00 sleep, 31:00 end"
    once = "07:05 wash, 07:30 tv, 15:00 court_hearing, 17:00 tv, 22:30 sleep, 31:10 end"
    made = private_days([parse_day(text) for text in (usual, once, usual)], 0)
    assert {"wash", "tv", "sleep"} == {name for day in made for name in day.activities}


@pytest.mark.skipif(not THOROUGH, reason="FLEET2D_THOROUGH=1 has it")
@pytest.mark.parametrize("name", LOGS)
def test_a_private_persona_is_nearly_as_close_to_days_held_back(shared_data, name):
    found = validate(timeline_of(shared_data / "activity" / name), private=True)
    (persona, _, chain, _), (exact, _, exact_chain, _) = found.rooms, found.seconds
    assert persona.hours < 0.55 * chain.hours
    assert exact.ks < 0.85 * exact_chain.ks


def nights(days, *states: ActivityPlace) -> Timeline:
    """Return days of the first state, and of the second from 23:00 to 07:00."""
    minutes = np.zeros((days, DAY_MINUTES), np.int16)
    minutes[:, 23 * 60 :], minutes[:, : 7 * 60] = 1, 1
    return Timeline(states, minutes, minutes.repeat(60, axis=1), None)


def test_what_is_not_in_a_log_is_said():
    timeline = nights(6, ActivityPlace("", "kitchen"), ActivityPlace("sleep", "bedroom"))
    timeline.minutes[:, 12 * 60 : 18 * 60] = -1
    timeline.seconds[:, 12 * 3600 : 18 * 3600] = -1
    notes = "; ".join(gaps(timeline, find_days(timeline)))
    assert "25% of the time is unknown" in notes
    assert "never be" not in notes
    assert "nobody is ever in a bathroom" in notes
    assert "nobody is ever out of the home" in notes
    assert "have no names" in notes
    assert "kitchen" not in notes


def test_rooms_whose_kind_nobody_knows_are_said():
    timeline = nights(6, ActivityPlace("", "zimmer_9"), ActivityPlace("sleep", "bedroom"))

    assert (
        "rooms of no known kind: zimmer_9; in a home without such rooms the persona is in any room"
        " instead: --rooms LABEL=KIND says what they are"
    ) in gaps(timeline, find_days(timeline))


# Distances


WHOLE = st.lists(st.integers(1, 50), min_size=1, max_size=30).map(
    lambda values: np.sort(np.array(values, np.float64))
)


@given(a=WHOLE, b=WHOLE)
def test_distances_of_samples_are_those_of_scipy(a, b):
    assert stats.ks_2samp(a, b).statistic == pytest.approx(ks_distance(a, b))
    assert stats.wasserstein_distance(a, b) == pytest.approx(wasserstein(a, b))


def test_stays_that_midnight_or_a_gap_cuts_are_left_out():
    day = np.zeros(DAY_MINUTES, np.int16)
    day[100:110] = 1
    day[200:230] = -1
    day[300:305] = 1
    # 0 from 110 to 200 is cut by the gap, from 230 to 300 too; the first and last by midnight.
    assert [[], [5.0, 10.0]] == [list(x) for x in dwell_times(day[None], 2)]


# The command


@pytest.mark.slow
def test_the_command_writes_a_persona_and_a_picture_and_says_how_good_it_is(
    tmp_path, monkeypatch, capsys
):
    log = write_life(tmp_path, 12)
    for name in ("SAMPLED", "CHAIN_DAYS", "SAMPLED_BY_SECOND", "CHAIN_DAYS_BY_SECOND"):
        monkeypatch.setattr(validation, name, 7)
    monkeypatch.chdir(tmp_path)
    arguments = ["fit", "persona", str(log), "--out", "ana.yaml", "--picture", "ana.png"]
    monkeypatch.setattr("sys.argv", ["fleet2d", *arguments])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    out = capsys.readouterr().out
    assert not caught.value.code
    assert (tmp_path / "ana.png").stat().st_size > 10_000
    assert out.endswith("ana.png\nana.yaml\n")
    assert ["  the persona", "  a first-order Markov chain"] == [
        line[:30].rstrip() for line in out.splitlines() if "persona  " in line or "Markov" in line
    ][:2]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda folder: write_life(folder, 2), "0 of the 2 days of the log are whole"),
        (lambda folder: folder / "none.txt", "no such file"),
        (lambda folder: _csv(folder), "is a log of positions"),
    ],
)
def test_a_log_that_nothing_can_be_fitted_to_is_refused(tmp_path, make, message):
    with pytest.raises(LogError, match=message):
        fit_routine(make(tmp_path), tmp_path / "persona.yaml")
    assert not (tmp_path / "persona.yaml").exists()


def _csv(folder: Path) -> Path:
    (folder / "a.csv").write_text("time,x,y\n1,2,3\n")
    return folder / "a.csv"
