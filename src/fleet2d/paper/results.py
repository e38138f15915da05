"""The results by name."""

from collections.abc import Callable, Sequence

from fleet2d.configuration.problems import suggest
from fleet2d.errors import InputError
from fleet2d.paper import feedback, ltp_gap, rtp_gap, speed
from fleet2d.paper.months import OnProgress, PaperOptions
from fleet2d.paper.result import Result

RESULTS: dict[str, Callable[[PaperOptions, OnProgress], Result]] = {
    speed.NAME: speed.reproduce,
    ltp_gap.NAME: ltp_gap.reproduce,
    rtp_gap.NAME: rtp_gap.reproduce,
    feedback.NAME: feedback.reproduce,
}


def check_names(names: Sequence[str]) -> list[str]:
    """Return the names of results in the order of the paper; all of them if `names` is empty.

    Raises:
        InputError: There is no such result.

    Example:
        >>> check_names(["feedback", "speed"])
        ['speed', 'feedback']
    """
    for name in names:
        if name not in RESULTS:
            raise InputError(f"there is no result {name!r}{suggest(name, RESULTS)}")
    return [name for name in RESULTS if name in names or not names]


def reproduce(name: str, options: PaperOptions, on_progress: OnProgress) -> Result:
    """Repeat the measurements of one result.

    Args:
        name: A key of `RESULTS`.
        options: The size.
        on_progress: Receives the progress.

    Raises:
        InputError: The map can't be read, or matplotlib is missing, which drawing frames needs.
    """
    return RESULTS[name](options, on_progress)
