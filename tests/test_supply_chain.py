"""What Fleet2D is built and tested with: the lock file, the licences in the docs, the actions of workflows."""

import importlib.metadata
import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from tools import licenses

ROOT = Path(licenses.ROOT)
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
LOCKED_EXTRAS = ("test", "browser", "lint", "page")


def needed(extra) -> list[Requirement]:
    """Return the packages that an extra names, those of the extras that it includes among them."""
    found = []
    for requirement in map(Requirement, PROJECT["optional-dependencies"][extra]):
        if requirement.name == PROJECT["name"]:
            found += [part for inner in sorted(requirement.extras) for part in needed(inner)]
        else:
            found.append(requirement)
    return found


def locked_versions():
    versions = {}
    for match in licenses.REQUIREMENT.finditer((ROOT / "requirements.lock").read_text("utf-8")):
        versions.setdefault(match["name"], []).append(match["version"])
    return versions


def test_the_lock_has_every_dependency_in_a_version_that_it_allows():
    requirements = [Requirement(text) for text in PROJECT["dependencies"]]
    requirements += [requirement for extra in LOCKED_EXTRAS for requirement in needed(extra)]

    versions = locked_versions()

    assert len(requirements) > 30
    for requirement in requirements:
        locked = versions[canonicalize_name(requirement.name)]
        assert all(requirement.specifier.contains(version) for version in locked), requirement


def test_every_package_of_the_lock_has_hashes():
    text = (ROOT / "requirements.lock").read_text("utf-8")
    entries = re.split(r"^(?=[a-z0-9])", text, flags=re.M)[1:]

    assert len(entries) == len(licenses.REQUIREMENT.findall(text))
    assert all(re.search(r"--hash=sha256:[0-9a-f]{64}", entry) for entry in entries)


def test_the_docs_have_the_licences_of_all_installed_dependencies():
    _, rest = licenses.PAGE.read_text(encoding="utf-8").split(licenses.BEGIN)
    rows = re.findall(r"^\| (\S[^|]*) \| ([^|]*) \|$", rest.split(licenses.END)[0], re.M)[2:]
    listed = {name: license_ for license_, names in rows for name in names.split(", ")}

    assert set(licenses.locked()) | {name for name, _ in licenses.bundled()} == set(listed)
    for name, license_ in licenses.bundled():
        assert listed[name] == license_
    versions = locked_versions()
    for name in licenses.locked():
        try:
            version = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue  # the page needs it, or other tests do
        if version in versions[name]:  # `.ci/bounds` installs others, too
            assert listed[name] == licenses.license_of(name), name


@pytest.mark.parametrize(
    "path", sorted((ROOT / ".github/workflows").glob("*.y*ml")), ids=lambda p: p.name
)
def test_actions_are_named_by_their_commits(path):
    """A tag can be moved to other code; a commit can't."""
    actions = re.findall(r"uses: (\S+)", path.read_text(encoding="utf-8"))

    assert actions
    assert [] == [name for name in actions if not re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", name)]
