"""The names of the package: each is where the package looks for it."""

from importlib import import_module

import fleet2d


def test_every_public_name_is_in_its_module() -> None:
    for name, module in fleet2d._HOME_OF.items():
        assert hasattr(import_module(f"fleet2d.{module}"), name), (name, module)
