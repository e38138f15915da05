"""Puts a built site into a folder of sites, as that of a version.

python tools/site_versions.py SITE SITES VERSION

The folder has `versions.json`, from which pages offer the other versions, newest first, and a page
that leads to the newest release, or to `dev` before there is one.
"""

import json
import shutil
import sys
from pathlib import Path

DEV = "dev"


def main() -> None:
    """Add the site that the command line names."""
    site, sites, version = sys.argv[1:]
    add(Path(site), Path(sites), version)


def add(site: Path, sites: Path, version: str) -> None:
    """Copy a site into the folder of its version, and renew what lists the versions."""
    target = sites / version
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(site, target)
    versions = sorted((path.name for path in sites.iterdir() if is_site(path)), key=age)
    entries = [{"version": name, "title": name, "aliases": []} for name in versions]
    (sites / "versions.json").write_text(json.dumps(entries, indent=2) + "\n", encoding="utf-8")
    newest = next((name for name in versions if name != DEV), DEV)
    page = f'<meta charset="utf-8"><meta http-equiv="refresh" content="0; url={newest}/">\n'
    (sites / "index.html").write_text(page, encoding="utf-8")
    (sites / ".nojekyll").touch()


def is_site(path: Path) -> bool:
    """Tell whether a folder has a site."""
    return (path / "index.html").is_file()


def age(name: str) -> tuple[int, ...]:
    """Return a key by which newer versions come first, and what isn't one comes last.

    >>> sorted(["0.9.0", "dev", "0.10.0"], key=age)
    ['0.10.0', '0.9.0', 'dev']
    """
    numbers = name.split(".")
    if not all(number.isdigit() for number in numbers):
        return (1,)
    return (0, *(-int(number) for number in numbers))


if __name__ == "__main__":
    main()
