"""JUnit XML of product tests, for the tools of a CI."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from fleet2d.artifacts.files import write_atomically
from fleet2d.errors import InputError

if TYPE_CHECKING:
    from fleet2d.cli.product_tests import Case

# What XML 1.0 has no way to write.
_UNWRITABLE = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_junit(path: Path, cases: "Sequence[Case]") -> None:
    """Write a test suite for each scenario, with a test for each expectation and seed.

    Raises:
        InputError: The file can't be written.
    """
    root = ET.Element("testsuites")
    for source in dict.fromkeys(case.source for case in cases):
        mine = [case for case in cases if case.source == source]
        suite = ET.SubElement(root, "testsuite", name=_plain(source))
        failures = errors = 0
        for case in mine:
            failures += sum(not verdict.holds for verdict in case.verdicts.values())
            errors += bool(case.error)
            _add_case(suite, case)
        counts = {"tests": len(suite), "failures": failures, "errors": errors, "skipped": 0}
        for name, count in counts.items():
            suite.set(name, str(count))
        suite.set("time", f"{sum(case.wall_s for case in mine):.3f}")
    ET.indent(root)
    text = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text)
    except OSError as error:
        raise InputError(f"--junit {path} can't be written: {error.strerror}") from None


def _add_case(suite: ET.Element, case: "Case") -> None:
    names = list(case.verdicts) or list(case.scenario.expect)
    for name in names:
        test = ET.SubElement(
            suite,
            "testcase",
            classname=_plain(Path(case.source).stem),
            name=f"{_plain(name)}[seed {case.seed}]",
            time=f"{case.wall_s / len(names):.3f}",
        )
        if case.error:
            error = ET.SubElement(test, "error", message=_plain(case.error))
            error.text = _plain(case.error)
            return
        verdict = case.verdicts[name]
        if not verdict.holds:
            failure = ET.SubElement(test, "failure", message=_plain(str(verdict)))
            kept = "".join(f"\nkept: {path}" for path in case.files)
            failure.text = _plain(f"{verdict}\nshown again by: {case.again(verdict)}{kept}")


def _plain(text: str) -> str:
    return _UNWRITABLE.sub("?", text)
