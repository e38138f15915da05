"""Exporters are found by the names of their modules, and among installed packages."""

from importlib.metadata import EntryPoint, EntryPoints

import pytest
from tests.scenes import Cli

from fleet2d.errors import InputError
from fleet2d.runs import exporters
from fleet2d.runs.exporters import exporter, formats


def test_module_of_a_format_exports() -> None:
    assert "fleet2d.runs.exporters.casas" == exporter("casas").__module__


def test_unknown_format_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"no exporter 'cassas': did you mean 'casas'\? There are"):
        exporter("cassas")


def test_help_of_the_command_names_each_format_and_what_it_is(fleet2d: Cli) -> None:
    _, out, _ = fleet2d("export", "--help")

    text = " ".join(out.split())
    assert formats()
    for name, description in formats().items():
        assert f"{name}: {description}" in text


def test_formats_of_installed_packages_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = EntryPoint("from_a_plugin", "somewhere:export", "fleet2d.exporter")
    monkeypatch.setattr(exporters, "_plugins", lambda: EntryPoints([entry]))

    assert "" == formats()["from_a_plugin"]
    assert {"casas", "from_a_plugin"} <= formats().keys()
