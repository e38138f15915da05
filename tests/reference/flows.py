"""Slow twin of the kernel of flows, in lists and dictionaries: the same sums in the same order."""

from collections.abc import Iterable, Sequence

NOTHING = 1e-12  # mass below which nothing is moved


def earth_mover(start: Sequence[float], end: Sequence[float], metres: list[list[float]]) -> float:
    """Return the least mean distance by which `start` is moved onto `end`."""
    surplus = [a - b for a, b in zip(start, end, strict=True)]
    sources = [i for i, mass in enumerate(surplus) if mass > NOTHING]
    sinks = [j for j, mass in enumerate(surplus) if mass < -NOTHING]
    flow = Flow([[metres[i][j] for j in sinks] for i in sources], [-surplus[j] for j in sinks])
    for row, i in enumerate(sources):
        rest = surplus[i]
        while rest > NOTHING and max(flow.demand, default=0.0) > NOTHING:
            rest -= flow.push(row, rest)
    return flow.cost


class Flow:
    """A minimum cost flow from sources to sinks, which grows by shortest paths.

    Dijkstra's algorithm finds these paths by reduced costs, the costs less the difference of the
    potentials of both ends, which are never below zero, and zero for edges in use.

    Attributes:
        metres: The cost of each edge, by source and sink.
        demand: The mass that each sink still lacks.
        mass: The flow along each edge, by source and sink.
    """

    def __init__(self, metres: list[list[float]], demand: list[float]) -> None:
        self.metres, self.demand = metres, demand
        self.mass = [[0.0] * len(demand) for _ in metres]
        self._source_potential, self._sink_potential = [0.0] * len(metres), [0.0] * len(demand)

    @property
    def cost(self) -> float:
        """The sum of mass times metres."""
        total = 0.0  # sum() adds in another way since Python 3.12
        for row, costs in zip(self.mass, self.metres, strict=True):
            for mass, metres in zip(row, costs, strict=True):
                total += mass * metres
        return total

    def push(self, source: int, most: float) -> float:
        """Send at most `most` mass from a source along a shortest path; return how much."""
        distance, parent = [float("inf")] * len(self.demand), [source] * len(self.demand)
        visited, back = {source: 0.0}, dict[int, int]()
        open_sinks = dict.fromkeys(range(len(self.demand)))  # whose distance isn't final yet
        self._relax(source, 0.0, distance, parent, open_sinks)
        while True:
            end = min(open_sinks, key=distance.__getitem__)
            if self.demand[end] > NOTHING:
                break
            del open_sinks[end]
            for i, row in enumerate(self.mass):
                if row[end] > NOTHING and i not in visited:
                    visited[i], back[i] = distance[end], end
                    self._relax(i, distance[end], distance, parent, open_sinks)
        for i, length in visited.items():
            self._source_potential[i] += distance[end] - length
        for j in range(len(self.demand)):
            if j not in open_sinks:
                self._sink_potential[j] -= distance[end] - distance[j]
        return self._augment(source, end, parent, back, most)

    def _relax(
        self,
        i: int,
        length: float,
        distance: list[float],
        parent: list[int],
        open_sinks: Iterable[int],
    ) -> None:
        """Shorten the distances of sinks by the edges of source `i`, `length` from the start."""
        begin, costs = length - self._source_potential[i], self.metres[i]
        for j in open_sinks:
            reduced = begin + costs[j] - self._sink_potential[j]
            if reduced < distance[j]:
                distance[j], parent[j] = reduced, i

    def _augment(
        self, source: int, end: int, parent: list[int], back: dict[int, int], most: float
    ) -> float:
        """Send mass to the sink `end` along the path found; return how much."""
        forward, backward = [(parent[end], end)], list[tuple[int, int]]()
        while (i := forward[-1][0]) != source:
            backward.append((i, back[i]))
            forward.append((parent[back[i]], back[i]))
        amount = min(most, self.demand[end], *(self.mass[i][j] for i, j in backward))
        for i, j in forward:
            self.mass[i][j] += amount
        for i, j in backward:
            self.mass[i][j] -= amount
        self.demand[end] -= amount
        return amount
