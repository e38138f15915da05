"""Slow, obvious twins of the heading kernels: sines to fifty digits, no libm."""

from decimal import Decimal, localcontext
from functools import cache

DIGITS = 60
PARTS = 8192
"""Half headings in a turn."""


@cache
def pi():
    """Return pi by Machin's formula, 16 atan(1/5) - 4 atan(1/239)."""
    with localcontext(prec=DIGITS + 10):
        return 16 * _atan_of_inverse(5) - 4 * _atan_of_inverse(239)


def _atan_of_inverse(n):
    term, total, k = 1 / Decimal(n), Decimal(0), 0
    while abs(term) > Decimal(10) ** -(DIGITS + 5):
        total += term / (2 * k + 1) * (-1) ** k
        term /= n * n
        k += 1
    return total


@cache
def sine(part):
    """Return the sine of part / 8192 of a turn, by its Taylor series."""
    with localcontext(prec=DIGITS):
        x = 2 * pi() * (part % PARTS) / PARTS
        term, total, k = x, Decimal(0), 1
        while abs(term) > Decimal(10) ** -(DIGITS - 2):
            total += term
            term = -term * x * x / ((k + 1) * (k + 2))
            k += 2
        return total


def cosine(part):
    """Return the cosine of part / 8192 of a turn."""
    return sine(part + PARTS // 4)


def alignment(part, dx, dy):
    """Return the length of (dx, dy) along the direction part / 8192 of a turn."""
    return dx * cosine(part) + dy * sine(part)


def nearest_headings(dx, dy):
    """Return the heading(s) best aligned with (dx, dy): two if no sixty digits tell them apart."""
    along = [(alignment(2 * heading, dx, dy), heading) for heading in _candidates(dx, dy)]
    best = max(along)[0]
    return {heading for value, heading in along if best - value < Decimal(10) ** -45}


def _candidates(dx, dy):
    """Halve the circle down to a few headings: alignment has one maximum on it."""
    low, high = max(
        (((q * 1024), (q + 1) * 1024) for q in range(4)),
        key=lambda arc: alignment(2 * arc[0], dx, dy) + alignment(2 * arc[1], dx, dy),
    )
    while high - low > 4:
        third = (high - low) // 3
        if alignment(2 * (low + third), dx, dy) < alignment(2 * (high - third), dx, dy):
            low += third
        else:
            high -= third
    return [heading % 4096 for heading in range(low - 2, high + 3)]
