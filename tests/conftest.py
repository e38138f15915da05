"""What all tests share."""

import gc
import os
import signal
import sys
import threading
from collections.abc import Generator
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from tests.thorough import THOROUGH, examples

from fleet2d import cli

_ROOT = Path(__file__).parents[1]

# No property fails by how long an example takes, or its making on a busy machine. Ordinary runs try
# the same examples each time, so that a fresh clone passes; thorough ones search for new examples.
hypothesis.settings.register_profile(
    "fleet2d",
    max_examples=examples(100),
    derandomize=not THOROUGH,
    deadline=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("fleet2d")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, Any, Any]:
    """Keep what is loaded and collected out of the garbage collector's scans: it lives to the end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give each worker neighboring tests, which share runs and homes, and none a long rest."""
    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log) if config.getoption("dist") == "load" else None


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(parent: pytest.Collector) -> Generator[None, Any, Any]:
    """Look for no doctests in tests: there are none, and it takes as long as to import them."""
    option = parent.config.option
    option.doctestmodules, before = False, option.doctestmodules
    try:
        return (yield)
    finally:
        option.doctestmodules = before


@pytest.fixture(scope="session")
def shared_data():
    """The folder of real inputs, which lies beside the repository and isn't part of it."""
    folder = Path(os.environ.get("FLEET2D_SHARED_DATA", _ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        reason = f"no real inputs in {folder} (FLEET2D_SHARED_DATA names another folder)"
        if os.environ.get("FLEET2D_REQUIRE_SHARED_DATA") == "1":
            pytest.fail(reason)
        pytest.skip(reason)
    return folder


@pytest.fixture(scope="session", autouse=True)
def _ctrl_c_is_heard():
    """Take Ctrl-C here and in processes begun from here, also where the suite's own ignores it.

    A shell starts a job in the background with SIGINT ignored, and children inherit that.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def fleet2d(monkeypatch, capsys, tmp_path):
    """The command line in this process, in an empty folder: (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str | Path) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["fleet2d", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            cli.main()
        out, err = capsys.readouterr()
        return int(caught.value.code or 0), out, err

    return call
