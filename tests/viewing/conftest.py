"""Runs that the tests of the viewer look at."""

import pytest
from tests.viewing.browser import chromium

import fleet2d

SCENARIO = {
    "extends": "bundled:paper",
    "simulation": {"duration": "9 h", "seed": 11},
    "floorplan": {"layers": {"dust": {"fill": 0.5}}},
    "objects": {
        "bath_door": {"type": "door", "doorway": "bathroom_1", "closes_after": "10 s"},
        "office_door": {"type": "door", "doorway": "office_1", "open": False},
    },
}


@pytest.fixture(scope="session", autouse=True)
def state_home(tmp_path_factory):
    """Keep the token of pages out of the state folder of whoever runs the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(scope="module")
def browser():
    """A browser for the tests of a module."""
    with chromium() as started:
        yield started


@pytest.fixture(scope="session")
def run_dir(tmp_path_factory):
    """A stored run of nine hours with doors and a layer."""
    folder = tmp_path_factory.mktemp("viewer") / "first"
    fleet2d.run(SCENARIO, out=folder)
    return folder


@pytest.fixture(scope="session")
def other_dir(tmp_path_factory):
    """The same with another seed."""
    folder = tmp_path_factory.mktemp("viewer") / "second"
    fleet2d.run(SCENARIO, out=folder, seed=12)
    return folder
