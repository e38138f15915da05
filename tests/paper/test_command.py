"""The command `fleet2d reproduce-paper`: what it prints and writes, and how it refuses."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from fleet2d import cli
from fleet2d.errors import InputError
from fleet2d.paper import command as paper
from fleet2d.paper import results

Result = tuple[int, str, str]
TINY = ("--quick", "--seeds", "1", "--days", "2", "--workers", "1")


@pytest.fixture
def reproduce(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> Callable[..., Result]:
    """The command in this process, in an empty folder: (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> Result:
        monkeypatch.setattr(sys, "argv", ["fleet2d", "reproduce-paper", *arguments])
        with pytest.raises(SystemExit) as caught:
            cli.main()
        out, err = capsys.readouterr()
        return int(caught.value.code or 0), out, err

    return call


def test_a_result_is_printed_kept_and_drawn(reproduce: Callable[..., Result]) -> None:
    code, out, _ = reproduce("ltp-gap", *TINY)
    assert 0 == code
    assert "Fig. 7 left" in out
    assert "the paper's figure" in out
    assert "living_room_0" in out
    names = sorted(path.name for path in Path("paper").iterdir())
    assert ["ltp-gap.json", "ltp-gap.png", "studies"] == names
    assert 2 == json.loads(Path("paper/ltp-gap.json").read_text(encoding="utf-8"))["days"]


@pytest.mark.slow
def test_units_in_brackets_are_printed(reproduce: Callable[..., Result]) -> None:
    code, out, _ = reproduce("rtp-gap", *TINY, "--out", "here/there")
    assert 0 == code
    assert "log loss [nats]" in out
    assert Path("here/there/rtp-gap.json").exists()


def test_without_matplotlib_numbers_are_still_written(
    reproduce: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(paper, "_can_draw", lambda: False)
    code, _, _ = reproduce("ltp-gap", *TINY)
    assert 0 == code
    assert {"ltp-gap.json", "studies"} == {path.name for path in Path("paper").iterdir()}


def test_missing_matplotlib_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "fleet2d.pictures", None)
    monkeypatch.delattr("fleet2d.pictures", raising=False)

    class Absent:
        """Finds fleet2d.pictures and says what is missing, as that does."""

        def find_spec(self, name: str, *_: object) -> None:
            if name == "fleet2d.pictures":
                raise InputError('drawing needs matplotlib: pip install "fleet2d[viz]"')

    monkeypatch.delitem(sys.modules, "fleet2d.pictures")
    monkeypatch.setattr(sys, "meta_path", [Absent(), *sys.meta_path])
    assert not paper._can_draw()
    assert 'pip install "fleet2d[viz]"' in capsys.readouterr().err


def test_results_come_in_the_order_of_the_paper(
    reproduce: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    measured = []
    for name in ("ltp_gap", "feedback"):
        monkeypatch.setattr(
            results,
            name,
            lambda _, name=name: measured.append(name) or results.Result(name, "", ()),
        )
    monkeypatch.setattr(paper, "_can_draw", lambda: False)
    code, _, _ = reproduce("feedback", "ltp-gap", "feedback", *TINY)
    assert 0 == code
    assert ["ltp_gap", "feedback"] == measured


def test_what_does_not_exist_is_refused(reproduce: Callable[..., Result]) -> None:
    code, _, err = reproduce("ltpgap")
    assert 2 == code
    assert "did you mean 'ltp-gap'?" in err
    assert not Path("paper").exists()


@pytest.mark.parametrize("option", ["--seeds", "--days", "--workers"])
def test_sizes_below_one_are_refused(reproduce: Callable[..., Result], option: str) -> None:
    code, _, err = reproduce("ltp-gap", option, "0")
    assert 2 == code
    assert option in err


def test_a_directory_that_is_a_file_is_refused_first(reproduce: Callable[..., Result]) -> None:
    Path("file").write_text("")
    code, _, err = reproduce("ltp-gap", "--out", "file")
    assert 2 == code
    assert "--out" in err
