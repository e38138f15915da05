"""Parse expectations from text: Python syntax, with quotes only where names need them."""

import ast
import operator
import re
from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

from fleet2d.configuration.problems import did_you_mean
from fleet2d.errors import InputError
from fleet2d.expectations import vocabulary
from fleet2d.expectations.expectation import Expectation
from fleet2d.expectations.signals import Signal, WordSignal

WORDS: Mapping[str, Callable[..., Any]] = {
    name: word
    for name, word in vars(vocabulary).items()
    if getattr(word, "__module__", "") == vocabulary.__name__ and not name.startswith("_")
}
"""The functions that a text may call, by name."""

_COMPARED: Mapping[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_JOINED: Mapping[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.And: operator.and_, ast.Or: operator.or_, ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
}  # fmt: skip
_MIRRORED: Mapping[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Gt: ast.Lt, ast.GtE: ast.LtE, ast.Lt: ast.Gt, ast.LtE: ast.GtE, ast.Eq: ast.Eq,
    ast.NotEq: ast.NotEq,
}  # fmt: skip

# Texts in quotes stay as they are; times of day and numbers with units are put into quotes.
_QUANTITY = re.compile(
    r"""("[^"]*"|'[^']*')|(\d{1,2}:\d\d(?:\s*-\s*\d{1,2}:\d\d)?)"""
    r"""|(?<![\w.])(\d+(?:\.\d+)?)\s*(%|(?:m/s|km/h|cm/s|cm|mm|m|min|minutes?|s|seconds?|h|hours?"""
    r"""|d|days?|w|weeks?)(?![\w(]))"""
)
_LONGEST = 2000
_DEEPEST = 40


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
        raise InputError(f"an expectation has {_LONGEST} characters at most, this has {len(text)}")
    try:
        tree = ast.parse(_QUANTITY.sub(_quoted, text.strip()), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError(
            f"{text!r} can't be read: write it like always(distance(ana, astro) > 0.5 m)"
        ) from None
    return _Reader().expectation(tree)


def _quoted(match: re.Match[str]) -> str:
    if match[1]:
        return match[1]
    return f'"{match[2]}"' if match[2] else f'"{match[3]} {match[4]}"'


class _Reader:
    """Reads the syntax tree of a text."""

    def __init__(self) -> None:
        self._depth = 0

    def expectation(self, node: ast.expr) -> Expectation:
        """Read a part that holds or doesn't."""
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
        return self._argument(node)

    def _joined(self, node: ast.BoolOp | ast.BinOp) -> Expectation:
        """Read parts joined by and, or, & or |."""
        joint = _JOINED.get(type(node.op))
        if joint is None:
            raise self._foreign(node)
        nodes = node.values if isinstance(node, ast.BoolOp) else [node.left, node.right]
        return reduce(joint, map(self.expectation, nodes))

    def _argument(self, node: ast.expr) -> Any:
        """Read a name, a path, a number, a text or a list."""
        match node:
            case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() | float() as value)):
                return -value
            case ast.Constant(value=str() | int() | float() | None as value):
                return value
            case ast.Name(id=name):
                return name
            case ast.Attribute():
                return f"{self.value(node.value)}.{node.attr}"
            case ast.Tuple(elts=elements) | ast.List(elts=elements):
                return tuple(self.value(element) for element in elements)
        raise self._foreign(node)

    def _foreign(self, node: ast.expr) -> InputError:
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
            return word(*arguments, **options)
        except (TypeError, ValueError) as error:
            what = str(error).replace(f"{name}()", name)
            raise InputError(f"{ast.unparse(node)}: {what}") from None

    def _comparison(self, node: ast.Compare) -> Expectation:
        sides = [self.value(side) for side in (node.left, *node.comparators)]
        joined: Expectation | None = None
        for left, sign, right in zip(sides, node.ops, sides[1:], strict=False):
            part = self._compared(left, sign, right, node)
            joined = part if joined is None else joined & part
        assert joined is not None
        return joined

    def _compared(self, left: Any, sign: ast.cmpop, right: Any, node: ast.Compare) -> Expectation:
        if isinstance(left, WordSignal) and isinstance(sign, ast.In | ast.NotIn):
            words = right if isinstance(right, tuple) else (right,)
            return left.is_in(*words) if isinstance(sign, ast.In) else ~left.is_in(*words)
        if isinstance(right, Signal | WordSignal) and not isinstance(left, Signal | WordSignal):
            left, right = right, left
            sign = _MIRRORED.get(type(sign), type(sign))()
        compare = _COMPARED.get(type(sign))
        numbers = isinstance(left, Signal) and not isinstance(right, Signal | WordSignal)
        equal = isinstance(left, WordSignal) and isinstance(sign, ast.Eq | ast.NotEq)
        if compare is None or not (numbers or equal):
            raise InputError(
                f"{ast.unparse(node)}: a signal is compared with a number, or room(…) and"
                " activity(…) by == with a name"
            )
        return compare(left, right)
