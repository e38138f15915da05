"""Count the attacks of `tests/hostile` and those that broke something, as docs/explanation/security.md lists them.

    python -m tests.hostile               # a part of the attacks
    FLEET2D_THOROUGH=1 python -m tests.hostile

A test case is an attack; one that tries several says how many by the property `tried`.
"""

import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree as ET

HERE = Path(__file__).parent


def count(file: Path, report: Path) -> tuple[int, int]:
    """Run the attacks of a file; return how many were tried, and how many test cases failed."""
    options = ["-q", "-m", "", "-o", "junit_family=xunit1"]  # slow ones, too; with properties
    options += ["-p", "no:cacheprovider", f"--junitxml={report}"]
    subprocess.run(
        [sys.executable, "-m", "pytest", *options, str(file)],
        cwd=HERE.parents[1],
        stdout=subprocess.DEVNULL,
        check=False,
    )
    tried = broken = 0
    for case in ET.parse(report).iter("testcase"):
        if case.find("skipped") is None:
            properties = case.iterfind("properties/property[@name='tried']")
            tried += max(1, sum(int(each.get("value", "1")) for each in properties))
            broken += any(case.find(end) is not None for end in ("failure", "error"))
    return tried, broken


def main() -> None:
    """Print a row of a Markdown table for each class of attacks."""
    print("| class | tried | broken |\n| --- | ---: | ---: |")
    total = 0
    with tempfile.TemporaryDirectory() as folder:
        for file in sorted({*HERE.glob("test_*.py")} - {HERE / "test_defences.py"}):
            tried, broken = count(file, Path(folder) / "report.xml")
            total += broken
            name = file.stem.removeprefix("test_").replace("_", " ")
            print(f"| {name} | {tried:,} | {broken} |", flush=True)
    sys.exit(1 if total else 0)


if __name__ == "__main__":
    main()
