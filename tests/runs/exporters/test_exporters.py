"""Exporters are found by the names of their modules, and among installed packages."""

import pytest

from fleet2d.errors import InputError
from fleet2d.runs.exporters import exporter


def test_module_of_a_format_exports() -> None:
    assert "fleet2d.runs.exporters.casas" == exporter("casas").__module__


def test_unknown_format_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"no exporter 'cassas': did you mean 'casas'\? There are"):
        exporter("cassas")
