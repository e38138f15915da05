"""Pictures of homes and runs: needs the extra `viz`, and nothing else in Fleet2D imports it."""

from fleet2d.errors import InputError

try:
    import matplotlib as mpl  # noqa: F401 - so that every module in here gives the hint
except ImportError:
    raise InputError('drawing needs matplotlib: pip install "fleet2d[viz]"') from None
