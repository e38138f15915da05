"""Policies: orders in which to look at the sites of a search problem.

All are functions of a :class:`~fleet2d.search.problem.SearchProblem` and return each site once.
Ties go to the lower site, so that an order is the same on every machine.
"""

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fleet2d.search.problem import SearchProblem
from fleet2d.streams import Draws

Policy = Literal["random", "nearest", "likeliest", "greedy", "exact", "receding"]

MOST_EXACT = 16
"""Exact orders take time and memory by 2**sites: 0.3 s and 25 MB for so many."""
HORIZON = 8
"""Sites that a receding horizon plans exactly for."""


def random_order(problem: SearchProblem, draws: Draws) -> list[int]:
    """Return the sites in random order."""
    return draws.shuffled(range(len(problem.prior)))


def nearest_first(problem: SearchProblem) -> list[int]:
    """Go on to whatever site is nearest, counting the look; blind to where the target may be."""
    return _step_by_step(problem, lambda way, _: -way)


def likeliest_first(problem: SearchProblem) -> list[int]:
    """Go on to whatever site the target is likeliest found at, however far it is."""
    return _step_by_step(problem, lambda _, gain: gain)


def greedy(problem: SearchProblem) -> list[int]:
    """Go on to whatever site has most chance per second of way and look."""
    return _step_by_step(problem, lambda way, gain: gain / max(way, 1e-9))


def exact(problem: SearchProblem) -> list[int]:
    """Return the order of least expected time: dynamic programming over subsets of sites.

    Bellman 1962 and Held and Karp 1962, for the sum of detection times in place of a tour's length:
    a second spent while the sites S are done counts by the chance that is still to come outside S.
    So the best cost from (S, i) on is V(S, i) = min over j outside S of
    (way(i, j) + look(j)) * gain(outside S) + V(S + j, j). Takes 2**n n**2 operations.

    Raises:
        ValueError: There are more than MOST_EXACT sites.

    Example:
        >>> from fleet2d.search.problem import search_problem
        >>> line = search_problem([0.2, 0.2, 0.6], [1, 2, 9], [[0, 3, 10], [3, 0, 11], [10, 11, 0]])
        >>> exact(line), likeliest_first(line)
        ([0, 1, 2], [2, 0, 1])
    """
    count = len(problem.prior)
    if count > MOST_EXACT:
        raise ValueError(
            f"an exact order of {count} sites takes too long: at most {MOST_EXACT} are worked out"
        )
    if not count:
        return []
    ways = problem.travel + problem.look
    choice, first = _solve(ways, problem.reach + problem.look, problem.gain)
    order, done = [first], 1 << first
    while len(order) < count:
        order.append(int(choice[done, order[-1]]))
        done |= 1 << order[-1]
    return order


def receding(problem: SearchProblem, horizon: int = HORIZON) -> list[int]:
    """Return the exact order of the most promising sites, and the others greedily behind them.

    To be asked again after every look, with the belief as it is then: only its first site counts.
    Promising is what :func:`greedy` would choose first.
    """
    rough = greedy(problem)
    kept = sorted(rough[:horizon])
    part = SearchProblem(
        problem.prior[kept],
        problem.reach[kept],
        problem.travel[np.ix_(kept, kept)],
        problem.look[kept],
        problem.detect[kept],
    )
    return [kept[site] for site in exact(part)] + rough[horizon:]


def order_by(policy: Policy, problem: SearchProblem, draws: Draws) -> list[int]:
    """Return the order of a policy by its name; only `random` draws."""
    if policy == "random":
        return random_order(problem, draws)
    return _ORDERS[policy](problem)


_ORDERS: dict[str, Callable[[SearchProblem], list[int]]] = {
    "nearest": nearest_first,
    "likeliest": likeliest_first,
    "greedy": greedy,
    "exact": exact,
    "receding": receding,
}


def after_empty_looks(
    prior: NDArray[np.float64],
    age: NDArray[np.float64],
    memory: float,
    detect: NDArray[np.float64] | float = 1.0,
) -> NDArray[np.float64]:
    """Return what is believed after looks that found nobody, not divided by its sum.

    A look that would have found the target with probability d takes d of what is believed of its
    site (Bayes). People move, so it counts less the older it is: by d * memory / (memory + age).
    With d = 1 it is the chance that another look, from the same place, finds somebody: who was
    there and hidden stays hidden.

    Args:
        prior: float64 (n,), belief without the looks.
        age: float64 (n,), seconds since the last look at each site; infinite if there was none.
        memory: Age at which a look counts half [s]; 0: looks say nothing of later.
        detect: d, for each site or for all.

    Example:
        >>> after_empty_looks(np.array([0.6, 0.4]), np.array([60.0, np.inf]), memory=60.0).tolist()
        [0.3, 0.4]
    """
    looked = np.isfinite(age)
    lasting = np.where(looked, memory / np.maximum(memory + np.where(looked, age, 0.0), 1e-9), 0.0)
    belief: NDArray[np.float64] = prior * (1 - detect * lasting)
    return belief


def _step_by_step(problem: SearchProblem, worth: Callable[[float, float], float]) -> list[int]:
    """Go on to the site of most worth, a function of the seconds to it and its gain."""
    gain, look = problem.gain.tolist(), problem.look.tolist()
    left, order = list(range(len(gain))), list[int]()
    while left:
        ways = problem.travel[order[-1]] if order else problem.reach
        best = max(left, key=lambda j: (worth(float(ways[j]) + look[j], gain[j]), -j))
        order.append(best)
        left.remove(best)
    return order


def _solve(
    ways: NDArray[np.float64], reach: NDArray[np.float64], gain: NDArray[np.float64]
) -> tuple[NDArray[np.int8], int]:
    """Return the best next site by (sites done, last), and the best first one.

    Args:
        ways: float64 (n, n), seconds from the end of one look to the end of the next.
        reach: float64 (n,), seconds to the end of a first look.
        gain: float64 (n,), the chance of each first look.
    """
    count = len(gain)
    subsets = np.arange(1 << count, dtype=np.int64)
    left = np.zeros(1 << count)  # the chance outside each subset
    size = np.zeros(1 << count, np.int64)
    for j, chance in enumerate(gain.tolist()):
        left += np.where(subsets >> j & 1, 0.0, chance)
        size += subsets >> j & 1
    cost = np.zeros((1 << count, count))
    choice = np.zeros((1 << count, count), np.int8)
    bits, last = np.left_shift(1, np.arange(count)), np.arange(count)
    for done in range(count - 1, 0, -1):
        layer = subsets[size == done]
        ahead = np.where(layer[:, None] & bits, np.inf, cost[layer[:, None] | bits, last])
        # By set, last site, and the one after it; of equal ones the first is chosen.
        total = left[layer][:, None, None] * ways + ahead[:, None, :]
        choice[layer] = total.argmin(axis=2)
        cost[layer] = total.min(axis=2)
    totals = left[0] * reach + cost[bits, last]
    return choice, int(np.argmin(totals))
