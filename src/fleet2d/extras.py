"""Packages that only some parts of Fleet2D need."""

from collections.abc import Iterator
from contextlib import contextmanager

from fleet2d.errors import InputError


@contextmanager
def extra(name: str, need: str) -> Iterator[None]:
    """Explain what to install if the imports in the block fail.

    Args:
        name: The extra of Fleet2D that has the package, such as study.
        need: What needs which package.

    Raises:
        InputError: The package is not installed.

    Example:
        >>> with extra("paint", "painting needs easel"):
        ...     import easel
        Traceback (most recent call last):
        fleet2d.errors.InputError: painting needs easel: pip install "fleet2d[paint]"
    """
    try:
        yield
    except ImportError:
        raise InputError(f'{need}: pip install "fleet2d[{name}]"') from None
