"""What a release brings beside the package: files that other programs read are what these expect."""

import json
import re
import tomllib
from pathlib import Path

import pytest
import yaml

import fleet2d

ROOT = Path(__file__).parents[1]


FORMS = sorted((ROOT / ".github/ISSUE_TEMPLATE").glob("[!c]*.yml"))
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"][
    "optional-dependencies"
]


def text(name):
    return (ROOT / name).read_text(encoding="utf-8")


def test_citation_names_the_paper_and_no_version_that_nobody_can_get():
    citation = yaml.safe_load(text("CITATION.cff"))
    assert {"cff-version", "message", "title", "authors", "license"} <= set(citation)
    paper = citation["preferred-citation"]
    assert "Fleet2D: A fast and light simulator for Home Robotics" == paper["title"]
    assert paper["title"] in text("README.md")
    assert {"version", "date-released", "doi"}.isdisjoint(citation)


@pytest.mark.parametrize("form", [pytest.param(form, id=form.stem) for form in FORMS])
def test_issue_form_has_what_forms_need(form):
    content = yaml.safe_load(form.read_text(encoding="utf-8"))
    assert {"name", "description", "body"} <= set(content)
    fields = [part for part in content["body"] if part["type"] != "markdown"]
    assert fields
    assert all(part["type"] in {"textarea", "input", "dropdown"} for part in fields)
    ids = [part["id"] for part in fields]
    assert len(ids) == len(set(ids))
    assert any(part.get("validations", {}).get("required") for part in fields)


def test_container_and_development_container_install_extras_that_there_are():
    content = json.loads(text(".devcontainer/devcontainer.json"))
    for command in (content["postCreateCommand"], text("Dockerfile")):
        extras = re.findall(r"\[([a-z,]+)\]", command)
        assert extras
        assert set(extras[0].split(",")) <= set(EXTRAS), command


def test_container_has_a_python_that_the_package_supports():
    versions = re.findall(r"python:3\.(\d+)-", text("Dockerfile"))
    assert len(set(versions)) == 1
    assert int(versions[0]) >= 11


def test_security_policy_leads_to_the_threat_model():
    assert "(docs/explanation/security.md)" in text("SECURITY.md")


def test_changelog_has_the_version_of_the_package_in_at_most_forty_lines():
    assert f"## {fleet2d.__version__}" in text("CHANGELOG.md")
    assert 40 >= len(text("CHANGELOG.md").splitlines())


def test_source_distribution_takes_nothing_from_an_environment_in_the_clone():
    build = tomllib.loads(text("pyproject.toml"))["tool"]["scikit-build"]["sdist"]
    assert [] == [pattern for pattern in build["include"] if not pattern.startswith("/")]
    assert all((ROOT / pattern[1:]).exists() for pattern in build["include"])
    assert {"/.venv", "/.git", "/build"} <= set(build["exclude"])
