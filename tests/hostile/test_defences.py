"""Each defence, taken out: a test fails, so that it can't get lost without a word."""

import os
import resource
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from tests.hostile.defences import DEFENCES
from tests.thorough import some

TESTS = Path(__file__).parent.parent
MEMORY = 8 << 30


def limit_memory():
    """Let nothing that was defended against fill the memory of the machine."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def source_of(defence):
    spec = find_spec(f"fleet2d.{defence.module}")
    assert spec is not None
    return Path(str(spec.origin)).read_text(encoding="utf-8")


@pytest.mark.parametrize("defence", DEFENCES, ids=lambda defence: defence.name)
def test_a_defence_is_there_once_and_so_is_its_test(defence):
    file, _, test = defence.test.partition("::")

    assert 1 == source_of(defence).count(defence.line)
    assert f"def {test.partition('[')[0]}(" in (TESTS / file).read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("defence", some(DEFENCES, 6), ids=lambda defence: defence.name)
def test_a_test_fails_without_the_defence(tmp_path, defence):
    module = f"fleet2d.{defence.module}"
    without = source_of(defence).replace(defence.line, defence.instead)
    compile(without, module, "exec")
    (tmp_path / "module.py").write_text(without, encoding="utf-8")
    overlay = {
        "PYTHONPATH": str(TESTS / "overlay"),
        "OVERLAY_MODULE": module,
        "OVERLAY_FILE": str(tmp_path / "module.py"),
    }
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "", "--tb=line"]
    command += ["-p", "no:cacheprovider", str(TESTS / defence.test)]
    done = subprocess.run(
        command,
        cwd=TESTS.parent,
        env={**os.environ, **overlay},
        capture_output=True,
        text=True,
        timeout=300,
        preexec_fn=limit_memory,
        check=False,
    )
    if "1 skipped" in done.stdout.splitlines()[-1]:
        pytest.skip("its test needs a library that isn't installed")
    assert "1 failed" in done.stdout.splitlines()[-1], done.stdout + done.stderr
