"""JUnit XML of a gate: a case for each expectation, with its numbers as properties."""

import re
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree as ET

from fleet2d.errors import InputError, os_errors_as
from fleet2d.storage.files import write_atomically
from fleet2d.testing.gate import NOT_RUN, UNDECIDED, UNTESTED, Gate, Tally

# Characters that XML 1.0 can't contain.
_ILLEGAL = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_junit(
    path: Path, gate: Gate, times_s: Mapping[str, float], hints: Mapping[Tally, str]
) -> None:
    """Write a test suite for each test, with a case for each expectation.

    Args:
        path: The file.
        gate: The gate.
        times_s: The wall time of each test [s].
        hints: How to see failures.

    Raises:
        InputError: The file can't be written.
    """
    root = ET.Element("testsuites")
    for test in dict.fromkeys(each.test for each in gate.tallies):
        tallies = [each for each in gate.tallies if each.test == test]
        suite = ET.SubElement(root, "testsuite", name=_xml_text(test))
        time_s = times_s.get(test, 0.0)
        for each in tallies:
            _add_case(suite, gate, each, time_s / len(tallies), hints.get(each, ""))
        counts = Counter(outcome.tag for outcome in suite.iterfind("testcase/*"))
        suite.set("tests", str(len(suite)))
        suite.set("failures", str(counts["failure"]))
        suite.set("errors", str(counts["error"]))
        suite.set("skipped", str(counts["skipped"]))
        suite.set("time", f"{time_s:.3f}")
    ET.indent(root)
    text = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    with os_errors_as(InputError, f"--junit {path} can't be written"):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text)


def _add_case(suite: ET.Element, gate: Gate, each: Tally, time_s: float, hint: str) -> None:
    case = ET.SubElement(
        suite,
        "testcase",
        classname=_xml_text(Path(each.test.partition("::")[0]).stem),
        name=_xml_text(each.name or "runs"),
        time=f"{time_s:.3f}",
    )
    properties = ET.SubElement(case, "properties")
    for name, value in _numbers(gate, each).items():
        ET.SubElement(properties, "property", name=name, value=_xml_text(str(value)))
    says = each.sentence()
    if each in gate.blocking:
        tag = "error" if each.errors else "failure"
        ET.SubElement(case, tag, message=_xml_text(says)).text = _xml_text(f"{says}\n{hint}")
    elif each in gate.known:
        message = f"{gate.known_as}: {says}"
        ET.SubElement(case, "skipped", message=_xml_text(message))
    elif each.verdict in (UNTESTED, UNDECIDED, NOT_RUN):
        ET.SubElement(case, "skipped", message=_xml_text(says))


def _numbers(gate: Gate, each: Tally) -> dict[str, object]:
    """Return the numbers of an expectation by name."""
    low, high = each.rate
    numbers: dict[str, object] = {
        "trials": each.trials,
        "held": each.held,
        "failed": len(each.failed),
        "rate_low": round(low, 4),
        "rate_high": round(high, 4),
        "covers": ", ".join(sorted(each.covers)),
    }
    if each.least_margin is not None:
        numbers["least_margin"], numbers["unit"] = each.least_margin
    change = gate.change_of.get(each.place)
    if change is not None:
        numbers |= {"worse": len(change.worse), "better": len(change.better)}
        numbers |= {"p": round(change.p, 6), "p_holm": round(change.p_holm, 6)}
    return numbers


def _xml_text(text: str) -> str:
    return _ILLEGAL.sub("?", text)
