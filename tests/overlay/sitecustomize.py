"""Load one module from another file: in a process of the tests, and in those that it starts.

Python imports this module at its start from a folder of PYTHONPATH.
"""

import os
import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import find_spec, spec_from_file_location
from pathlib import Path

MODULE = os.environ.get("OVERLAY_MODULE", "")
TEXT = os.environ.get("OVERLAY_FILE", "")


class _Loader(SourceFileLoader):
    """Runs the other text; the module's path, and all that lies beside it, stay as they are."""

    def get_code(self, fullname: str):
        return compile(Path(TEXT).read_bytes(), self.path, "exec", dont_inherit=True)


class _Finder(MetaPathFinder):
    def find_spec(self, fullname: str, path: object, target: object = None) -> ModuleSpec | None:
        if fullname != MODULE:
            return None
        sys.meta_path.remove(self)
        found = find_spec(fullname)
        sys.meta_path.insert(0, self)
        places = found.submodule_search_locations
        loader = _Loader(fullname, found.origin)
        return spec_from_file_location(
            fullname, found.origin, loader=loader, submodule_search_locations=places
        )


if MODULE:
    sys.meta_path.insert(0, _Finder())
