"""Exporters are found by the names of their modules, and among installed packages."""

from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import pytest
from tests.live.exporters.worlds import stored

from fleet2d.errors import InputError
from fleet2d.live import exporters
from fleet2d.live.exporters import exporter, format_of, formats, new_file


def test_module_of_a_format_exports():
    assert "fleet2d.live.exporters.texts" == exporter("casas").__module__


def test_unknown_format_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match=r"no exporter 'cassas': did you mean 'casas'\? There are"):
        exporter("cassas")


def test_help_of_the_command_names_each_format_and_what_it_is(fleet2d):
    _, out, _ = fleet2d("export", "--help")

    text = " ".join(out.split())
    assert formats()
    for name, description in formats().items():
        assert f"{name}: {description}" in text


def test_formats_of_installed_packages_are_listed(monkeypatch):
    entry = EntryPoint("from_a_plugin", "somewhere:export", "fleet2d.exporter")
    monkeypatch.setattr(exporters, "_plugins", lambda: EntryPoints([entry]))

    assert "" == formats()["from_a_plugin"]
    assert {"casas", "from_a_plugin"} <= formats().keys()


@pytest.mark.parametrize(
    ("name", "layout"),
    [
        ("w.mcap", "mcap"),
        ("w.MCAP", "mcap"),
        ("w.txt", "casas"),
        ("w", "rosbag2"),
        ("w.csv", "csv"),
        ("w.perfetto", "perfetto"),
    ],
)
def test_suffix_of_a_file_tells_its_format(name, layout):
    assert layout == format_of(Path(name))


def test_suffix_of_no_format_is_refused_with_those_there_are(tmp_path, fleet2d):
    run = stored(tmp_path)

    code, _, err = fleet2d("export", run, "week.xlsx")

    assert (2, True) == (code, "no format has the suffix '.xlsx'" in err and ".jsonl" in err)


def test_command_writes_a_part_of_a_run(tmp_path, fleet2d):
    run = stored(tmp_path)

    code, out, _ = fleet2d(
        "export", run, "w.csv", "--from", "1 min", "--to", "3 min", "--every", "10 s"
    )

    assert (0, "24 poses in w.csv\n") == (code, out)
    assert 25 == len((tmp_path / "w.csv").read_text().splitlines())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--every", "1.5 s"), "--every"),
        (("--every", "often"), "--every: expected a duration"),
        (("--every", "0 s"), "--every"),
        (("--from", "3 d"), "is not within the run"),
        (("--speed", "0"), "w.csv is no film: leave out --speed"),
    ],
)
def test_wrong_option_is_one_line(tmp_path, fleet2d, options, message):
    code, out, err = fleet2d("export", stored(tmp_path), "w.csv", *options)

    assert (2, "", 1) == (code, out, len(err.splitlines()))
    assert message in err
    assert not (tmp_path / "w.csv").exists()


def test_failed_export_leaves_the_file_as_it_was(tmp_path):
    path = tmp_path / "w.csv"
    path.write_text("before")

    def fail():
        with new_file(path) as file:
            file.write(b"half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()

    assert "before" == path.read_text()
    assert [path] == list(tmp_path.iterdir())
