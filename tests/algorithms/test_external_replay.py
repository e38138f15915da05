"""Beliefs of a real algorithm, replayed from a table: newest shares, rooms, people, errors."""

import pytest

import fleet2d
from fleet2d.errors import InputError


def scenario(path, **settings):
    return {
        "extends": "bundled:paper",
        "simulation": {"duration": "4 h", "seed": 4},
        "algorithms": {
            "ltp": {"type": "replay", "path": str(path), "period": "1 h"} | settings,
        },
    }


def write(folder, text):
    path = folder / "belief.csv"
    path.write_text(text)
    return path


ROWS = """time,user,room,share
2026-01-05 01:30:00,ana,kitchen_1,0.75
2026-01-05 01:30:00,ana,living_room_1,0.25
2026-01-05 03:00:00,ana,kitchen_1,0.1
2026-01-05 03:00:00,ana,living_room_1,0.9
2026-01-05 03:00:00,ben,kitchen_1,1
"""


def shares(run, room):
    return [r["share"] for r in run.tables["ltp"].to_pylist() if r["room"] == room]


def test_the_newest_shares_are_put_out(tmp_path):
    run = fleet2d.run(scenario(write(tmp_path, ROWS), user="ana"))

    assert shares(run, "kitchen_1") == [0.75, 0.1, 0.1] or shares(run, "kitchen_1") == [
        0.75,
        0.75,
        0.1,
    ]
    assert run.manifest["inputs"][0]["path"].endswith("belief.csv")


def test_what_a_run_stored_is_put_out_again(tmp_path):
    content = {"extends": "bundled:paper", "simulation": {"duration": "4 h", "seed": 4}}
    content["algorithms"] = {"ltp": {"type": "long_term_presence", "period": "1 h"}}
    first = fleet2d.run(content, out=tmp_path / "first")

    again = fleet2d.run(scenario(tmp_path / "first" / "ltp.parquet", user="ana"))

    stored = [
        r for r in first.tables["ltp"].to_pylist() if r["user"] == "ana" and r["room"] != "away"
    ]
    last = [r["share"] for r in stored][-14:]
    last = [share / sum(last) for share in last]
    assert [r["share"] for r in again.tables["ltp"].to_pylist()][-14:] == pytest.approx(last)


@pytest.mark.parametrize(
    ("text", "settings", "message"),
    [
        (ROWS, {}, "holds 2 users: ana, ben: select one by 'user'"),
        (ROWS, {"user": "anna"}, "has no user 'anna': did you mean 'ana'"),
        ("time,room,share\n0,attic,1\n", {}, "there is no room 'attic'"),
        ("time,room\n0,kitchen_1\n", {}, "has no column 'share'"),
    ],
)
def test_a_table_of_another_home_is_refused(tmp_path, text, settings, message):
    with pytest.raises(InputError, match=message):
        fleet2d.Simulation(scenario(write(tmp_path, text), **settings))


@pytest.mark.parametrize("day", ["2026-01-04", "2026-01-06"])
def test_a_table_of_another_time_is_refused_with_both_ranges(tmp_path, day):
    path = write(tmp_path, ROWS.replace("2026-01-05", day))
    ranges = rf"from {day} 01:30:00 to {day} 03:00:00, and the run is from 2026-01-05 00:00:00 to"
    with pytest.raises(InputError, match=f"{ranges} 2026-01-05 04:00:00"):
        fleet2d.Simulation(scenario(path, user="ana"))


def test_a_table_that_ends_during_the_run_is_put_out(tmp_path):
    path = write(tmp_path, ROWS.replace("2026-01-05 01", "2026-01-04 01"))

    assert shares(fleet2d.run(scenario(path, user="ana")), "kitchen_1")[0] == 0.75
