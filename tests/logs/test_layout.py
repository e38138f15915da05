"""Layouts tell their lines from those of others."""

import pytest
from tests.logs.test_layout_reading import ADLS, CASAS, HOMER, SENSORS

from fleet2d.logs.layout import LAYOUTS, read_log
from fleet2d.logs.log import LogError

SAMPLES = {"casas": [CASAS], "homer": [HOMER], "uci_adl": [ADLS, SENSORS]}


@pytest.mark.parametrize(("name", "text"), [(n, t) for n, ts in SAMPLES.items() for t in ts])
def test_no_line_shows_two_layouts(name, text):
    lines = text.splitlines()
    shown = {other for other, layout in LAYOUTS.items() for line in lines if layout.matches(line)}

    assert {name} == shown


def test_readings_of_a_thermometer_are_casas_and_other_words_are_not():
    casas = LAYOUTS["casas"]

    assert casas.matches("2020-03-02 07:00:00.5 Kitchen T101 21.5")
    assert not casas.matches("hello world")
    assert not casas.matches("2020-03-02 07:00 > 08:00 kitchen breakfast")


def test_a_folder_is_recognized_beside_other_texts_in_it(tmp_path):
    (tmp_path / "about.txt").write_text("Real days of one person.\n")
    (tmp_path / "home_ADLs.txt").write_text(ADLS)

    assert "uci_adl" == read_log(tmp_path).layout


def test_a_folder_of_another_layout_is_refused(tmp_path):
    (tmp_path / "events.txt").write_text(CASAS)

    with pytest.raises(LogError, match=r"several files \(.*homer, .*\): for other layouts"):
        read_log(tmp_path)
