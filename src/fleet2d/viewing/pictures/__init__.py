"""Pictures of homes and runs: needs the extra `viz`."""

from fleet2d.errors import extra

with extra("viz", "drawing needs matplotlib"):
    import matplotlib as mpl  # noqa: F401 - so that every module in here gives the hint
