"""What expectations are worth at each step, step by step, in slow and obvious Python."""

from math import inf
from typing import Any

Formula = tuple[Any, ...]
"""("is", name), ("above", name, limit), ("not", f), ("and", f, g), ("always", f, steps or None), …"""


def robustness(
    formula: Formula,
    signals: dict[str, list[float]],
    step: int,
    end: int,
    *,
    over: bool,
    high: bool,
) -> float:
    """Return the robustness of a formula at a step.

    Args:
        formula: The formula.
        signals: The values of each signal, step by step.
        step: The step.
        end: The step before which what is known ends.
        over: Whether nothing comes after that.
        high: Whether the best is assumed of what isn't known.
    """

    def of(part: Formula, at: int, best: bool = high) -> float:
        return robustness(part, signals, at, end, over=over, high=best)

    def later(steps: int | None) -> tuple[range, bool]:
        """Return the known steps of a window, and whether it goes on beyond them."""
        last = end - 1 if steps is None else step + steps
        unknown = not over if steps is None else last >= end
        return range(step, min(last, end - 1) + 1), unknown

    match formula:
        case ("is", name):
            return inf if signals[name][step] > 0 else -inf
        case ("above", name, limit):
            return signals[name][step] - limit
        case ("not", part):
            return -of(part, step, not high)
        case ("and", one, other):
            return min(of(one, step), of(other, step))
        case ("or", one, other):
            return max(of(one, step), of(other, step))
        case ("always", part, steps):
            window, unknown = later(steps)
            beyond = [inf if high else -inf] if unknown else []
            return min([*(of(part, t) for t in window), *beyond])
        case ("eventually", part, steps):
            window, unknown = later(steps)
            beyond = [inf if high else -inf] if unknown else []
            return max([*(of(part, t) for t in window), *beyond])
        case ("until", hold, goal, steps):
            window, unknown = later(steps)
            held, ways = inf, []
            for t in window:
                ways.append(min(held, of(goal, t)))
                held = min(held, of(hold, t))
            # Beyond what is known the goal may come, as long as it was held until then.
            ways += [min(held, inf if high else -inf)] if unknown else []
            return max(ways)
        case ("after", trigger, part, steps):
            is_on = [of(trigger, t, False) > 0 for t in range(end)]
            begins = [t for t in range(end) if is_on[t] and (t == 0 or not is_on[t - 1])]
            whole = ("eventually", part, steps) if steps is not None else part
            coming = [of(whole, t) for t in begins if t >= step]
            return min([*coming, *([] if over else [inf if high else -inf])], default=inf)
        case ("holds_for", part, steps):
            if step - steps + 1 < 0:
                return -inf
            return min(of(part, t) for t in range(step - steps + 1, step + 1))
    raise AssertionError(formula)
