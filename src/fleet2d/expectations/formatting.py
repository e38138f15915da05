"""Format expectations as text that `parse_expectation` reads back."""

from datetime import timedelta
from typing import Any

from fleet2d.configuration.units import format_duration


def argument_text(value: Any) -> str:
    """Write an argument of a call.

    >>> argument_text("ana"), argument_text((1.0, 2.5)), argument_text(timedelta(minutes=2))
    ('"ana"', '(1, 2.5)', '"2 min"')
    """
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, timedelta):
        return f'"{format_duration(value)}"'
    if isinstance(value, tuple):
        return f"({', '.join(map(argument_text, value))})"
    if isinstance(value, float):
        return number_text(value, "")
    return str(value)


def call_text(name: str, *arguments: Any, **options: Any) -> str:
    """Write a call; arguments and options that are None are left out.

    >>> call_text("seen", "ana", by="astro")
    'seen("ana", by="astro")'
    """
    listed = [argument_text(value) for value in arguments if value is not None]
    listed += [f"{k}={argument_text(v)}" for k, v in options.items() if v is not None]
    return f"{name}({', '.join(listed)})"


def number_text(value: float, unit: str) -> str:
    """Write a number with its unit; shares in percent.

    >>> number_text(0.5, "m"), number_text(0.1, "share"), number_text(3.0, "")
    ('0.5 m', '10 %', '3')
    """
    if unit == "share":
        return f"{_plain(round(100 * value, 10))} %"
    return f"{_plain(value)} {unit}" if unit else _plain(value)


def _plain(value: float) -> str:
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)
