"""The columns that several tables of a run share."""

from fleet2d.artifacts.table import Column

STEP = Column("step", "step", description="step at which the row takes effect")
TIME = Column("time", "time", description="local time")
X = Column("x", "float64", "m", nullable=True)
Y = Column("y", "float64", "m", nullable=True)
HEADING = Column("heading", "float64", "rad", description="counter-clockwise from +x")


def away_column(meaning: str) -> Column:
    """Return the column that is true while a body isn't at home, and what other columns mean then.

    >>> away_column("x and y are missing").description
    'not at home: x and y are missing'
    """
    return Column("away", "bool", description=f"not at home: {meaning}")
