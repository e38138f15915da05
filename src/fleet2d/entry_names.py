"""Entries of a scenario that have names: what names may be, and entries typed by their names."""

import re
from collections.abc import Mapping
from typing import Any

from pydantic import BeforeValidator

from fleet2d.bounds import one_line
from fleet2d.problems import problem_at

_FORM = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,99}")


def _check_names(entries: Any) -> Any:
    """Refuse names that can't be part of a key path, a file name or a table name."""
    if isinstance(entries, Mapping):
        for name in entries:
            if not _FORM.fullmatch(str(name)):
                raise problem_at(
                    (name,),
                    f"the name {one_line(repr(name))} must be letters, digits, '_' and '-', a"
                    " letter first, 100 characters at most",
                )
    return entries


def _name_as_type(entries: Any) -> Any:
    """Let `ltp_error: {of: ltp}` stand for `ltp_error: {type: ltp_error, of: ltp}`."""
    if not isinstance(entries, Mapping):
        return entries
    return {
        name: {"type": name, **entry} if isinstance(entry, Mapping) else entry
        for name, entry in entries.items()
    }


CheckNames = BeforeValidator(_check_names)
"""Declares that the keys of a mapping are names of entries."""

NameAsType = BeforeValidator(_name_as_type)
"""Declares that an entry without a `type` is of the type of its name."""
