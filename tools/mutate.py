"""Try random mutants: change one expression of a module, and see whether a test of it fails.

    python tools/mutate.py --number 100 --seed 1 > mutants.jsonl

Modules are chosen evenly by their size, a kind of change and its place by chance. Each mutant runs
the tests that mirror its module, and then those that name it, until one fails.
"""

import argparse
import ast
import json
import os
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from itertools import accumulate
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "src"
OVERLAY = ROOT / "tests" / "overlay"
COMPARED = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
COMPUTED = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}


def compare(node: ast.AST) -> ast.AST | None:
    """Move or turn a comparison."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARED:
        other = COMPARED[type(node.ops[0])]()
        return ast.Compare(node.left, [other, *node.ops[1:]], node.comparators)
    return None


def compute(node: ast.AST) -> ast.AST | None:
    """Turn an operator of arithmetic."""
    if isinstance(node, ast.BinOp) and type(node.op) in COMPUTED:
        return ast.BinOp(node.left, COMPUTED[type(node.op)](), node.right)
    return None


def connect(node: ast.AST) -> ast.AST | None:
    """Turn `and` into `or`, and `or` into `and`."""
    if isinstance(node, ast.BoolOp):
        return ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)
    return None


def affirm(node: ast.AST) -> ast.AST | None:
    """Remove a `not`."""
    is_not = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
    return node.operand if is_not else None


def count_one_more(node: ast.AST) -> ast.AST | None:
    """Add one to a number, or turn a truth value."""
    if isinstance(node, ast.Constant) and isinstance(node.value, int):
        is_truth = isinstance(node.value, bool)
        return ast.Constant(not node.value if is_truth else node.value + 1)
    return None


def return_none(node: ast.AST) -> ast.AST | None:
    """Return nothing."""
    is_value = isinstance(node, ast.Return) and node.value is not None
    return ast.Return(ast.Constant(None)) if is_value else None


def remove(node: ast.AST) -> ast.AST | None:
    """Remove a statement that doesn't bind a name."""
    is_call = isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    return ast.Pass() if is_call or isinstance(node, ast.AugAssign | ast.Raise) else None


def swap(node: ast.AST) -> ast.AST | None:
    """Swap the first two arguments of a call."""
    if isinstance(node, ast.Call) and len(node.args) > 1:
        return ast.Call(node.func, [node.args[1], node.args[0], *node.args[2:]], node.keywords)
    return None


CHANGES = (compare, compute, connect, affirm, count_one_more, return_none, remove, swap)
UNTRIED = ("annotation", "returns")  # types are for readers


def parts_of(parent: ast.AST) -> Iterator[tuple[ast.AST, str, int | None]]:
    """Yield the parts of a node, each with the field and the index in it, if that is a list."""
    for name, value in ast.iter_fields(parent):
        if name in UNTRIED or isinstance(parent, ast.JoinedStr):
            continue
        if isinstance(value, list):
            parts = (part for part in enumerate(value) if isinstance(part[1], ast.AST))
            yield from ((part, name, index) for index, part in parts)
        elif isinstance(value, ast.AST):
            yield value, name, None


def mutant(source: str, generator: random.Random) -> tuple[str, str, int]:
    """Return the text of a mutant, the name of the change, and its line."""
    tree = ast.parse(source)
    places = [(parent, *part) for parent in ast.walk(tree) for part in parts_of(parent)]
    changes = [change for change in CHANGES if any(change(place[1]) for place in places)]
    change = generator.choice(changes)
    parent, node, name, index = generator.choice([p for p in places if change(p[1])])
    if index is None:
        setattr(parent, name, change(node))
    else:
        getattr(parent, name)[index] = change(node)
    line = getattr(node, "lineno", 0)
    return ast.unparse(ast.fix_missing_locations(tree)), change.__name__, line


def tests_of(module: Path) -> list[str]:
    """Return the files of tests that mirror a module, and then those that name it.

    Where there are neither, they are those that name its package.
    """
    within = module.relative_to(SOURCE / "fleet2d")
    mirrors = sorted((ROOT / "tests" / within.parent).glob(f"test_{within.stem}*.py"))
    name = ".".join(("fleet2d", *within.with_suffix("").parts)).removesuffix(".__init__")
    package, _, stem = name.rpartition(".")
    found = mirrors + files_with(name, f"from {package} import {stem}")
    return [str(path) for path in dict.fromkeys(found or files_with(package))]


def files_with(*words: str) -> list[Path]:
    """Return at most eight files of tests that contain one of some words."""
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    texts = ((path, path.read_text(encoding="utf-8")) for path in files)
    return [path for path, text in texts if any(word in text for word in words)][:8]


def run_tests(module: Path, text: str, tests: list[str], seconds: float) -> tuple[str, str]:
    """Return how the tests of a mutant end, and the first that fails."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "mutant.py"
        file.write_text(text, encoding="utf-8")
        name = ".".join(module.relative_to(SOURCE).with_suffix("").parts)
        overlaid = {
            "PYTHONPATH": str(OVERLAY),
            "OVERLAY_MODULE": name.removesuffix(".__init__"),
            "OVERLAY_FILE": str(file),
        }
        for marker in ("not slow", "slow"):
            command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "--tb=no"]
            command += ["-p", "no:cacheprovider", "-m", marker, *tests]
            try:
                done = subprocess.run(  # noqa: S603 - the command is ours
                    command,
                    env={**os.environ, **overlaid},
                    cwd=ROOT,
                    timeout=seconds,
                    capture_output=True,
                    text=True,
                    check=False,
                )
            except subprocess.TimeoutExpired:
                return "out of time", marker
            if done.returncode in (1, 2, 3):  # a test, or what it imports, fails
                failed = [line for line in done.stdout.splitlines() if "::" in line]
                return "killed", (failed or done.stdout.splitlines() or done.stderr[-300:])[-1]
    return "survived", ""


def main() -> None:
    """Print a line of JSON for each mutant."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--number", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=60, help="for the tests of a mutant")
    options = parser.parse_args()
    generator = random.Random(options.seed)  # noqa: S311 - no secret
    modules = [path for path in sorted(SOURCE.rglob("*.py")) if path.stat().st_size > 500]
    sizes = list(accumulate(path.stat().st_size for path in modules))
    step = sizes[-1] / options.number
    marks = [step * (number + generator.random()) for number in range(options.number)]
    chosen = [
        next(m for m, end in zip(modules, sizes, strict=True) if end > mark) for mark in marks
    ]
    mutants = [(path, *mutant(path.read_text(encoding="utf-8"), generator)) for path in chosen]
    generator.shuffle(mutants)  # so that an early end has tried all packages
    for number, (path, text, change, line) in enumerate(mutants):
        tests = tests_of(path)
        outcome, test = run_tests(path, text, tests, options.seconds)
        entry = {"number": number, "module": str(path.relative_to(ROOT)), "line": line}
        entry |= {"change": change, "outcome": outcome, "test": test, "files": len(tests)}
        print(json.dumps(entry), flush=True)


if __name__ == "__main__":
    main()
