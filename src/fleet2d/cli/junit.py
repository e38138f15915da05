"""JUnit XML of product tests, for the tools of a CI."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from fleet2d.errors import InputError
from fleet2d.storage.files import write_atomically

if TYPE_CHECKING:
    from fleet2d.cli.scenario_case import ScenarioCase

# Characters that XML 1.0 can't contain.
_ILLEGAL = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_junit(path: Path, cases: "Sequence[ScenarioCase]") -> None:
    """Write a test suite for each scenario, with a test for each expectation and seed.

    Raises:
        InputError: The file can't be written.
    """
    root = ET.Element("testsuites")
    for source in dict.fromkeys(case.source for case in cases):
        cases_of_source = [case for case in cases if case.source == source]
        suite = ET.SubElement(root, "testsuite", name=_xml_text(source))
        failures = errors = 0
        for case in cases_of_source:
            failures += sum(not verdict.holds for verdict in case.verdicts.values())
            errors += bool(case.error)
            _add_case(suite, case)
        counts = {"tests": len(suite), "failures": failures, "errors": errors, "skipped": 0}
        for name, count in counts.items():
            suite.set(name, str(count))
        suite.set("time", f"{sum(case.wall_s for case in cases_of_source):.3f}")
    ET.indent(root)
    text = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text)
    except OSError as error:
        raise InputError(f"--junit {path} can't be written: {error.strerror}") from None


def _add_case(suite: ET.Element, case: "ScenarioCase") -> None:
    names = list(case.verdicts) or list(case.scenario.expect)
    for name in names:
        test = ET.SubElement(
            suite,
            "testcase",
            classname=_xml_text(Path(case.source).stem),
            name=f"{_xml_text(name)}[seed {case.seed}]",
            time=f"{case.wall_s / len(names):.3f}",
        )
        if case.error:
            error = ET.SubElement(test, "error", message=_xml_text(case.error))
            error.text = _xml_text(case.error)
            return
        verdict = case.verdicts[name]
        if not verdict.holds:
            failure = ET.SubElement(test, "failure", message=_xml_text(str(verdict)))
            files = "".join(f"\nstored: {path}" for path in case.files)
            failure.text = _xml_text(f"{verdict}\nto see it: {case.commands(verdict)}{files}")


def _xml_text(text: str) -> str:
    return _ILLEGAL.sub("?", text)
