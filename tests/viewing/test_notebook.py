"""Runs and homes show themselves."""

import os
import subprocess
import sys

import pytest

import fleet2d
from fleet2d.errors import InputError
from fleet2d.viewing.notebook import home_png, run_html


@pytest.mark.slow
def test_run_draws_itself_and_its_moments(run_dir):
    from matplotlib.figure import Figure

    run = fleet2d.open_run(run_dir)
    assert isinstance(fleet2d.draw(run), Figure)
    assert isinstance(fleet2d.draw(run, at=20_000), Figure)
    axes = Figure().add_subplot()
    assert axes is fleet2d.draw(run, at="day 1 05:00", ax=axes)
    assert len(axes.patches) > 2


@pytest.mark.slow
def test_run_and_home_show_themselves_in_a_notebook(run_dir):
    run = fleet2d.open_run(run_dir)
    assert str(run.digest)[:12] in run_html(run)
    assert "<img" in run_html(run)
    picture = home_png(fleet2d.Home(run.plan))
    assert picture is not None
    assert picture.startswith(b"\x89PNG")


CELL = """
import fleet2d
run = fleet2d.run(None, "simulation.duration=10 min", seed=1)
"""
NOTEBOOK = f"""
from IPython.core.interactiveshell import InteractiveShell
shell = InteractiveShell.instance()
assert shell.run_cell({CELL!r}).success
for shown in ("run", "run.plan", "fleet2d.Home(run.plan)"):
    content, _ = shell.display_formatter.format(eval(shown, shell.user_ns))
    print(*sorted(content))
"""


@pytest.mark.slow
def test_cell_of_a_notebook_that_only_imports_fleet2d_shows_runs_and_homes(tmp_path):
    pytest.importorskip("IPython", reason="IPython is not installed")
    command = [sys.executable, "-c", NOTEBOOK]
    environment = {**os.environ, "IPYTHONDIR": str(tmp_path)}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)

    assert done.stdout.splitlines() == ["text/html text/plain", *["image/png text/plain"] * 2], (
        done.stderr
    )


@pytest.mark.slow
def test_violated_expectation_comes_before_the_facts_of_a_run_and_notes_are_calm():
    changes = ("simulation.duration=1 min", "expect.still=never(moving(astro))")
    run = fleet2d.run("bundled:paper", *changes, "expect.any=always(distance(ana, astro) > 0 m)")
    run.notes.append("a remark")
    shown = run_html(run)
    verdict = shown.index("\u2717 1 of 2 expectations violated: still at Mon 05 Jan 00:00:0")
    assert verdict < shown.index("still is violated: never(moving") < shown.index("complete")
    assert 1 == shown.count("border-left")
    run.manifest["expectations"]["still"]["holds"] = True
    calm = run_html(run)
    assert "<p>2 expectations: 2 held</p>" in calm
    assert "border-left" not in calm
    run.manifest["status"] = "failed"
    assert "\u2717 the run failed; 2 expectations: 2 held" in run_html(run)


def test_run_is_a_widget(run_dir):
    pytest.importorskip("anywidget", reason="anywidget is not installed")
    widget = fleet2d.view(fleet2d.open_run(run_dir), height=400)
    assert 400 == widget.height
    assert "fleet2d-runs" in widget.content


def test_run_shows_itself_in_marimo(run_dir):
    marimo = pytest.importorskip("marimo", reason="marimo is not installed")
    run = fleet2d.open_run(run_dir)
    assert "<marimo-anywidget" in marimo.as_html(fleet2d.view(run)).text


@pytest.mark.parametrize("is_home", [False, True])
def test_missing_library_is_named(run_dir, monkeypatch, is_home):
    run = fleet2d.open_run(run_dir)
    drawing = ("fleet2d.viewing.pictures", "fleet2d.viewing.figures", "matplotlib")
    for name in [name for name in sys.modules if name.startswith(drawing)]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)

    with pytest.raises(InputError, match=r"need.* matplotlib: pip install"):
        fleet2d.draw(run.plan if is_home else run)
