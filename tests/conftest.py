"""What all tests share."""

import os
from pathlib import Path

import pytest

_ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real inputs, which lies beside the repository and isn't part of it."""
    folder = Path(os.environ.get("FLEET2D_SHARED_DATA", _ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        reason = f"no real inputs in {folder} (FLEET2D_SHARED_DATA names another folder)"
        if os.environ.get("FLEET2D_REQUIRE_SHARED_DATA") == "1":
            pytest.fail(reason)
        pytest.skip(reason)
    return folder
