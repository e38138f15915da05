"""Examples in docstrings of modules that need an extra run where it is installed."""

from importlib.util import find_spec

EXTRAS = {"gymnasium": "src/fleet2d/gym", "torch": "src/fleet2d/datasets/torch_data.py"}
collect_ignore = [path for package, path in EXTRAS.items() if find_spec(package) is None]
