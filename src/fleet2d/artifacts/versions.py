"""Versions of the software that ran a simulation."""

import os
import sys


def versions() -> dict[str, str]:
    """Return the versions of all software that the numbers of a run may depend on."""
    packages = {name: _version(name) for name in ("fleet2d", "numpy", "pyarrow", "shapely")}
    machine = os.uname().machine if hasattr(os, "uname") else "unknown"
    python = ".".join(map(str, sys.version_info[:3]))
    return {**packages, "python": python, "platform": f"{sys.platform} {machine}"}


def _version(package: str) -> str:
    # Searching the installed packages takes longer than simulating a day.
    version = getattr(sys.modules.get(package), "__version__", None)
    if isinstance(version, str):
        return version
    from importlib import metadata

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"
