"""What expectations are worth at each step, step by step, in slow and obvious Python.

Formulas are ("is", name), ("above", name, limit), ("not", f), ("and", f, g), ("always", f, steps or None), …
"""

from math import inf
from sys import float_info


def robustness(
    formula,
    signals,
    step,
    end,
    *,
    over,
    high,
):
    """Return the robustness of a formula at a step.

    Args:
        formula: The formula.
        signals: The values of each signal, step by step.
        step: The step.
        end: The step before which what is known ends.
        over: Whether nothing comes after that.
        high: Whether the best is assumed of what isn't known.
    """

    def of(part, at, best=high):
        return robustness(part, signals, at, end, over=over, high=best)

    def later(steps):
        """Return the known steps of a window, and whether it goes on beyond them."""
        low, high = steps if isinstance(steps, tuple) else (0, steps)
        last = end - 1 if high is None else step + high
        unknown = not over if high is None else last >= end
        return range(step + low, min(last, end - 1) + 1), unknown

    def earlier(steps):
        """Return the steps of a window in the past, the latest first."""
        low, high = steps if isinstance(steps, tuple) else (0, steps)
        return range(step - low, -1 if high is None else max(-1, step - high - 1), -1)

    match formula:
        case ("is", name):
            return inf if signals[name][step] > 0 else -inf
        case ("true",):
            return inf
        case ("above", name, limit):
            return signals[name][step] - limit
        case ("less", one, other):
            return signals[other][step] - signals[one][step] or -float_info.min  # never 0
        case ("not", part):
            return -of(part, step, not high)
        case ("and", one, other):
            return min(of(one, step), of(other, step))
        case ("or", one, other):
            return max(of(one, step), of(other, step))
        case ("implies", one, other):
            return of(("or", ("not", one), other), step)
        case ("once", part, steps):
            return of(("since", ("true",), part, steps), step)
        case ("since", hold, goal, steps):
            ways = [
                min([of(goal, t), *(of(hold, u) for u in range(t + 1, step + 1))])
                for t in earlier(steps)
            ]
            return max(ways, default=-inf)
        case ("always", part, steps):
            return -of(("eventually", ("not", part), steps), step, not high)
        case ("eventually", part, steps):
            return of(("until", ("true",), part, steps), step)
        case ("until", hold, goal, steps):
            window, unknown = later(steps)
            ways = [min([of(goal, t), *(of(hold, u) for u in range(step, t))]) for t in window]
            # Beyond what is known the goal may come, as long as it was held until then.
            held = min((of(hold, u) for u in range(step, end)), default=inf)
            ways += [min(held, inf if high else -inf)] if unknown else []
            return max(ways, default=-inf)
        case ("after", trigger, part, steps):
            is_on = [of(trigger, t, False) > 0 for t in range(end)]
            begins = [t for t in range(end) if is_on[t] and (t == 0 or not is_on[t - 1])]
            whole = ("eventually", part, steps) if steps is not None else part
            coming = [of(whole, t) for t in begins if t >= step]
            return min([*coming, *([] if over else [inf if high else -inf])], default=inf)
        case ("holds_for", part, steps):
            if step - steps < 0:
                return -inf
            return min(of(part, t) for t in range(step - steps, step + 1))
    raise AssertionError(formula)
