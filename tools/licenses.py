"""Write the licences of all dependencies, those of the page too, into docs/explanation.

python tools/licenses.py          # write; all of requirements.lock must be installed
python tools/licenses.py --check  # say whether it is as it should be
"""

import argparse
import importlib.metadata
import json
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs/explanation/dependencies.md"
BEGIN, END = "<!-- licences: made by tools/licenses.py -->\n", "<!-- end of licences -->\n"
REQUIREMENT = re.compile(
    r"^(?P<name>[a-z0-9._-]+)==(?P<version>\S+)(?: ; (?P<marker>[^\\]+))? ", re.M
)
# Needed on other platforms only, where nothing is tested.
ELSEWHERE = re.compile(r"sys_platform == '(win32|emscripten)'")
# What the metadata of packages say, and its identifier of SPDX.
IDENTIFIERS = {
    "any-OSI": "any-OSI",
    "Apache 2.0": "Apache-2.0",
    "Apache Software License": "Apache-2.0",
    "BSD": "BSD-3-Clause",
    "BSD 2-Clause License": "BSD-2-Clause",
    "BSD 3-Clause License": "BSD-3-Clause",
    "BSD License": "BSD-3-Clause",
    "ISC License (ISCL)": "ISC",
    "MIT License": "MIT",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
}


def main() -> int:
    """Write the table, or compare it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    text = PAGE.read_text(encoding="utf-8")
    page = with_table(text)
    if parser.parse_args().check:
        return int(page != text)
    PAGE.write_text(page, encoding="utf-8")
    return 0


def with_table(text: str) -> str:
    """Return a page with the table as it should be."""
    head, rest = text.split(BEGIN)
    return f"{head}{BEGIN}{table()}{END}{rest.split(END)[1]}"


def table() -> str:
    """Return a Markdown table of licences, and the packages that have them."""
    packages = defaultdict(list)
    for name in locked():
        packages[license_of(name)].append(name)
    for name, license_ in bundled():
        packages[license_].append(name)
    rows = [
        f"| {license_} | {', '.join(sorted(packages[license_]))} |" for license_ in sorted(packages)
    ]
    return "\n".join(["", "| licence | packages |", "| --- | --- |", *rows, "", ""])


def locked() -> list[str]:
    """Return the names of the packages in requirements.lock that Linux and macOS need."""
    text = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    found = REQUIREMENT.finditer(text)
    return sorted({m["name"] for m in found if not ELSEWHERE.search(m["marker"] or "")})


def license_of(name: str) -> str:
    """Return the identifier of the licence of an installed package.

    Raises:
        importlib.metadata.PackageNotFoundError: It isn't installed.
        KeyError: Its metadata name no licence that is known here.
    """
    metadata = importlib.metadata.metadata(name)
    if expression := metadata.get("License-Expression"):
        return expression
    text = metadata.get("License") or ""
    field = text.partition("\n")[0].strip()
    if field in IDENTIFIERS.values() or " AND " in field:
        return field
    classifiers = [name.rpartition(" :: ")[2] for name in metadata.get_all("Classifier") or []]
    said = [name for name in (field, *classifiers) if name in IDENTIFIERS]
    if not said and "Permission is hereby granted, free of charge" in text:
        return "MIT"
    return IDENTIFIERS[said[0] if said else field]


def bundled() -> Iterator[tuple[str, str]]:
    """Yield the libraries in the bundle of the page, and their licences."""
    lock = json.loads((ROOT / "page" / "package-lock.json").read_text(encoding="utf-8"))
    for path, package in lock["packages"].items():
        if path and not package.get("dev"):
            yield path.removeprefix("node_modules/"), package["license"]


if __name__ == "__main__":
    raise SystemExit(main())
