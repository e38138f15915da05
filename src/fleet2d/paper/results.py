"""The results by name."""

from collections.abc import Callable, Sequence

from fleet2d.errors import InputError
from fleet2d.paper import feedback, ltp_gap, rtp_gap, speed
from fleet2d.paper.months import Request, Tell
from fleet2d.paper.result import Result
from fleet2d.problems import did_you_mean

RESULTS: dict[str, Callable[[Request, Tell], Result]] = {
    speed.NAME: speed.reproduce,
    ltp_gap.NAME: ltp_gap.reproduce,
    rtp_gap.NAME: rtp_gap.reproduce,
    feedback.NAME: feedback.reproduce,
}


def chosen(names: Sequence[str]) -> list[str]:
    """Return the names of results that are asked for, in the order of the paper; none: all.

    Raises:
        InputError: There is no such result.

    Example:
        >>> chosen(["feedback", "speed"])
        ['speed', 'feedback']
    """
    for name in names:
        if name not in RESULTS:
            raise InputError(
                f"there is no result {name!r}{did_you_mean(name, RESULTS)} There are:"
                f" {', '.join(RESULTS)}"
            )
    return [name for name in RESULTS if name in names or not names]


def reproduce(name: str, request: Request, tell: Tell) -> Result:
    """Measure one result anew.

    Args:
        name: One of `RESULTS`.
        request: How large.
        tell: Told of progress.

    Raises:
        InputError: The map can't be read, or matplotlib is missing for what is watched.
    """
    return RESULTS[name](request, tell)
