"""Read expectations: text in Python's syntax.

Names need quotes only where they aren't one word.
"""

import ast
import inspect
import operator
import re
from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any, NamedTuple

from fleet2d.configuration.problems import did_you_mean, problem
from fleet2d.errors import InputError, errors_as

# These modules define the words of texts.
from fleet2d.expectations import learned as learned
from fleet2d.expectations import temporal as temporal
from fleet2d.expectations import vocabulary as vocabulary
from fleet2d.expectations.expectation import WORDS, Expectation
from fleet2d.expectations.signals import Signal, WordSignal
from fleet2d.expectations.verdict import check_judged

_OPERATORS: Mapping[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.And: operator.and_,
    ast.Or: operator.or_,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_ARITHMETIC = (ast.Add, ast.Sub, ast.Mult, ast.Div)
_MIRRORED = {ast.Gt: ast.Lt, ast.GtE: ast.LtE, ast.Lt: ast.Gt, ast.LtE: ast.GtE}

# Texts in quotes stay as they are; kinds of rooms, times and numbers with units get quotes.
_UNIT = (
    r"(?:%|(?:m/s|km/h|cm/s|cm|mm|m|min|minutes?|s|seconds?|h|hours?|d|days?|w|weeks?)(?![\w(]))"
)
_NUMBER = r"\d+(?:\.\d+)?"
_QUANTITY = re.compile(
    r"""(?P<quoted>"[^"]*"|'[^']*')|(?P<kind>\bany\s+[a-z_]\w*)"""
    r"""|(?P<time>\d{1,2}:\d\d(?:\s*-\s*\d{1,2}:\d\d)?)"""
    rf"""|(?<![\w.])(?P<number>(?:{_NUMBER}\s*{_UNIT}?\s*\.\.\s*)?{_NUMBER}\s*{_UNIT})"""
)
# Answers to requests, as in `remind(ana) accepted within 30 min`, become calls of `answered`.
_ANSWERED = re.compile(
    r"(\w+)\s*\(([^(),]+)\)\s+(?!(?:and|or|in|not|is|if|else)\b)([a-z_]+)\b"
    r"(?:\s+within\s+([^),&|]+?)(?=\s*(?:$|[),&|])|\s+(?:and|or)\b))?"
)
_LONGEST = 2000
_DEEPEST = 40


# Spellings of other languages, with the form for Python.
_SLIPS = (
    (r"\s*=>\s*", " >= "), (r"\s*=<\s*", " <= "), (r"(?<=\))\s*=\s*(?!=)", " == "),
    (r"\s*&&\s*", " and "), (r"\s*\|\|\s*", " or "),
)  # fmt: skip


def parse_expectation(text: str) -> Expectation:
    """Read an expectation, or a part of one.

    Raises:
        InputError: The text is not an expectation; the message has the nearest word.

    Example:
        >>> print(parse_expectation("always(distance(ana, astro) > 50 cm)"))
        always(distance("ana", "astro") > 0.5 m)
        >>> parse_expectation("allways(moving(ana))")
        Traceback (most recent call last):
        fleet2d.errors.InputError: there is no 'allways': did you mean 'always'?
    """
    if len(text) > _LONGEST:
        raise InputError(
            f"an expectation may have at most {_LONGEST} characters; this one has {len(text)}"
        )
    try:
        words = _ANSWERED.sub(_answered, text.strip())
        tree = ast.parse(_QUANTITY.sub(_quoted, words), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        right = text
        for slip, form in _SLIPS:
            right = re.sub(slip, form, right)
        form = "it like always(distance(ana, astro) > 0.5 m)" if right == text else right
        raise InputError(f"{text!r} can't be read: write {form}") from None
    return _Reader().expectation(tree)


def _quoted(match: re.Match[str]) -> str:
    return match[0] if match["quoted"] else f'"{" ".join(match[0].split())}"'


def _answered(match: re.Match[str]) -> str:
    interaction, person, outcome, within = match.groups()
    limit = f", within={within}" if within else ""
    return f"answered({interaction}, {person}, {outcome}{limit})"


class _Reader:
    """Reads the syntax tree of a text."""

    def __init__(self) -> None:
        self._depth = 0

    def expectation(self, node: ast.expr) -> Expectation:
        """Read an operand that is true or false at each step."""
        value = self.value(node)
        if isinstance(value, Expectation):
            return value
        if isinstance(value, Signal | WordSignal):
            raise InputError(
                f"{value} is compared with nothing: write {value} > 0.5, or == kitchen"
            )
        raise InputError(
            f"{ast.unparse(node)} is not a condition: write one that is true or false, such as"
            " ana.battery > 0.5 or during('22:00-07:00')"
            f"{did_you_mean(value, WORDS)}"
        )

    def value(self, node: ast.expr) -> Any:
        """Read any part: an expectation, a signal, or an argument."""
        self._depth += 1
        if self._depth > _DEEPEST:
            raise InputError("the expectation is nested too deeply")
        try:
            return self._read(node)
        finally:
            self._depth -= 1

    def _read(self, node: ast.expr) -> Any:
        match node:
            case ast.Call():
                return self._call(node)
            case ast.Compare():
                return self._comparison(node)
            case ast.BoolOp() | ast.BinOp():
                return self._joined(node)
            case ast.UnaryOp(op=ast.Not() | ast.Invert()):
                return ~self.expectation(node.operand)
            case ast.UnaryOp(op=ast.USub()):
                operand = self.value(node.operand)
                if isinstance(operand, int | float | Signal):
                    return -operand
        return self._argument(node)

    def _joined(self, node: ast.BoolOp | ast.BinOp) -> Any:
        """Read parts joined by and, or, &, | or arithmetic."""
        if type(node.op) not in _OPERATORS:
            raise self._syntax_error(node)
        nodes = node.values if isinstance(node, ast.BoolOp) else [node.left, node.right]
        if not isinstance(node.op, _ARITHMETIC):
            return reduce(_OPERATORS[type(node.op)], map(self.expectation, nodes))
        operands = [self.value(each) for each in nodes]
        if not any(isinstance(operand, Signal) for operand in operands):
            raise self._syntax_error(node)
        try:
            return _OPERATORS[type(node.op)](*operands)
        except TypeError:
            raise InputError(f"{ast.unparse(node)}: only numbers can be computed with") from None

    def _argument(self, node: ast.expr) -> Any:
        """Read a name, a path, a number, a text or a list."""
        match node:
            case ast.Constant(value=str() | int() | float() | None as value):
                return value
            case ast.Name(id=name):
                return name
            case ast.Attribute():
                return f"{self.value(node.value)}.{node.attr}"
            case ast.Tuple(elts=elements) | ast.List(elts=elements):
                return tuple(self.value(element) for element in elements)
        raise self._syntax_error(node)

    def _syntax_error(self, node: ast.expr) -> InputError:
        return InputError(
            f"{ast.unparse(node)} can't be part of an expectation (a name with signs in it needs"
            ' quotes, like "robot-1")'
        )

    def _call(self, node: ast.Call) -> Any:
        name = node.func.id if isinstance(node.func, ast.Name) else ast.unparse(node.func)
        word = WORDS.get(name)
        if word is None:
            raise InputError(f"there is no {name!r}{did_you_mean(name, WORDS)}")
        arguments = [self.value(argument) for argument in node.args]
        options = {str(k.arg): self.value(k.value) for k in node.keywords}
        try:
            inspect.signature(word).bind(*arguments, **options)
            return word(*arguments, **options)
        except (TypeError, ValueError) as error:
            raise InputError(f"{ast.unparse(node)}: {error}") from None

    def _comparison(self, node: ast.Compare) -> Expectation:
        sides = [self.value(side) for side in (node.left, *node.comparators)]
        signs = [type(sign) for sign in node.ops]
        pairs = zip(sides, signs, sides[1:], strict=False)
        return reduce(operator.and_, (self._compared(*pair, node) for pair in pairs))

    def _compared(self, left: Any, sign: type[ast.cmpop], right: Any, node: ast.Compare) -> Any:
        if isinstance(left, WordSignal) and sign in (ast.In, ast.NotIn):
            is_in = left.is_in(*(right if isinstance(right, tuple) else (right,)))
            return is_in if sign is ast.In else ~is_in
        if isinstance(right, Signal | WordSignal) and not isinstance(left, Signal | WordSignal):
            left, right, sign = right, left, _MIRRORED.get(sign, sign)
        numbers = isinstance(left, Signal) and not isinstance(right, WordSignal)
        words = isinstance(left, WordSignal) and sign in (ast.Eq, ast.NotEq)
        if sign not in _OPERATORS or not (numbers or words):
            raise InputError(
                f"{ast.unparse(node)}: a signal is compared with a number or another signal, or"
                " room(…) and activity(…) by == with a name"
            )
        return _OPERATORS[sign](left, right)


class Expected(NamedTuple):
    """An expectation of a scenario.

    Attributes:
        that: The expectation.
        covers: The requirements that it covers, such as "REQ-12".
    """

    that: Expectation
    covers: tuple[str, ...] = ()

    def content(self) -> Any:
        """Return the entry of a scenario file: text, or a mapping if it covers requirements."""
        text = str(self.that)
        return {"that": text, "covers": list(self.covers)} if self.covers else text


def read_expected(value: Any) -> Expected:
    """Read an entry of the section `expect` of a scenario.

    Raises:
        PydanticCustomError: The entry can't be read, or doesn't say when it must hold.

    Example:
        >>> read_expected({"that": "never(moving(ana))", "covers": ["REQ-12"]}).covers
        ('REQ-12',)
    """
    covers: tuple[str, ...] = ()
    if isinstance(value, Mapping):
        if set(value) != {"that", "covers"}:
            raise problem(
                "expected two lines, such as `that: always(distance(ana, astro) > 0.5 m)` and"
                f" `covers: [REQ-12]`, got the keys {', '.join(map(str, value)) or '(none)'};"
                " within { } an expectation needs quotes"
            )
        with errors_as(problem):
            covers = read_requirements(value["covers"])
        value = value["that"]
    if isinstance(value, Expected):
        return value
    if isinstance(value, Expectation):
        return Expected(value, covers)
    if not isinstance(value, str):
        raise problem(
            f"expected an expectation like always(distance(ana, astro) > 0.5 m), got {value!r}"
        )
    with errors_as(problem):
        return Expected(check_judged(parse_expectation(value)), covers)


def read_requirements(value: Any) -> tuple[str, ...]:
    """Read a list of requirements.

    Raises:
        InputError: The value is no list of requirements.
    """
    is_list = isinstance(value, list | tuple)
    if not is_list or not all(isinstance(text, str) and text.strip() for text in value):
        raise InputError(f"covers: expected a list of requirements like [REQ-12], got {value!r}")
    return tuple(dict.fromkeys(text.strip() for text in value))
