"""Results of metrics as tables."""

from fleet2d.metrics.bodies import Distance
from fleet2d.metrics.interactions import Interactions
from fleet2d.metrics.metric import Metric
from fleet2d.metrics.results import ResultRow, block_of, blocks_of


def test_people_are_columns_and_measures_rows():
    astro = {"ana": {"kept": 0.5, "wanted": 2}, "ben": {"kept": 1.0, "wanted": 30}}

    block = block_of("requests", Interactions, {"astro": astro})

    kept = ResultRow("kept", ["50.0 %", "100.0 %"], "share of requests")
    wanted = ResultRow("wanted", ["2", "30"], "requests")
    assert [ResultRow("requests", ["astro · ana", "astro · ben"], ""), kept, wanted] == block.rows
    assert 0 == block.hidden


def test_person_without_a_measure_leaves_its_place_empty():
    astro = {"ana": {"wanted": 2}, "ben": {"kept": 1.0, "wanted": 30}}

    _, wanted, kept = block_of("requests", Interactions, {"astro": astro}).rows

    assert (["2", "30"], ["", "100.0 %"]) == (wanted.values, kept.values)


def test_numbers_nested_in_a_subject_are_counted_as_hidden():
    numbers = {"wanted": 2, "interrupted": {"tv": 1, "phone": 3}, "asked": 4}

    block = block_of("requests", Interactions, {"astro": {"ana": numbers}})

    assert ["requests", "wanted"] == [row.name for row in block.rows]
    assert 3 == block.hidden


def test_subjects_alone_stand_in_one_row():
    block = block_of("distance", Distance, {"ana": 743.2, "astro": 1095.3})

    assert [
        ResultRow("distance", ["ana", "astro"], ""),
        ResultRow("", ["743", "1,095"], "m a day"),
    ] == block.rows


def test_more_subjects_than_columns_are_rows():
    block = block_of("distance", Distance, {f"user{i}": float(i) for i in range(7)})

    assert 8 == len(block.rows)
    assert ResultRow("user3", ["3"], "") == block.rows[4]


def test_measures_without_a_subject_are_rows():
    block = block_of("team", Interactions, {"kept": 0.5, "woke": 3})

    assert ["team", "kept", "woke"] == [row.name for row in block.rows]


def test_metric_that_measured_nothing_is_left_out():
    configured = {"power": {"type": "battery"}, "way": {"type": "distance"}}

    blocks = blocks_of({"power": {}, "way": {"ana": 3.0}}, configured)

    assert ["way"] == [block.rows[0].name for block in blocks]


def test_small_share_is_not_told_as_none():
    shares = {"ana": {"kept": 0.0, "answered": 0.0004, "accepted": 0.001}}

    _, *rows = block_of("requests", Interactions, {"astro": shares}).rows

    assert [["0.0 %"], ["< 0.1 %"], ["0.1 %"]] == [list(row.values) for row in rows]


def test_result_without_numbers_has_no_rows_but_the_head():
    assert 1 == len(block_of("battery", Metric, {}).rows)
