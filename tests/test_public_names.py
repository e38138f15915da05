"""The public names: those of `fleet2d` and `fleet2d.testing`, each imported when it is first used."""

import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

import fleet2d

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("name", fleet2d.__all__)
def test_every_public_name_can_be_imported(name):
    assert getattr(fleet2d, name) is not None
    assert name in dir(fleet2d)


def test_stub_has_the_public_names_with_their_modules():
    stub = Path(fleet2d.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    imports = re.findall(r"^from (\S+) import (\w+) as \2$", stub, re.MULTILINE)

    assert sorted([name for _, name in imports] + ["__version__"]) == fleet2d.__all__
    for module, name in imports:
        assert getattr(import_module(module), name) is getattr(fleet2d, name)


NEEDED = {
    "fleet2d.learning.gym": "gymnasium",
    "fleet2d.learning.datasets.training": "torch",
    "fleet2d.learning.datasets.torch_data": "torch",
}
"""Libraries of extras that modules need, where tests may run without them."""


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Roomba'"):
        fleet2d.Roomba  # noqa: B018


def test_documented_modules_are_named_as_public():
    """What the documentation imports is public, and the page of the interface lists it."""
    page = (ROOT / "docs/reference/api.md").read_text(encoding="utf-8")
    documented = set()
    for file in [
        ROOT / "README.md",
        *(ROOT / "docs").rglob("*.md"),
        *(ROOT / "examples").glob("*.py"),
    ]:
        text = file.read_text(encoding="utf-8")
        documented |= set(re.findall(r"^(?:from|import) (fleet2d[\w.]*)", text, re.MULTILINE))

    assert documented - {"fleet2d"}
    for module in sorted(documented):
        needed = [library for begin, library in NEEDED.items() if module.startswith(begin)]
        if all(map(find_spec, needed)):
            import_module(module)
        assert f"`{module}`" in page, (
            f"{module} is documented, and docs/reference/api.md doesn't list it"
        )
