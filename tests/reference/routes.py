"""Slow, obvious twins of the route kernels: every corner with every corner, then Dijkstra."""

import heapq
import math

import numpy as np
import shapely

from fleet2d.kernels import I64, Bool

Graph = list[list[tuple[int, float]]]


def region_of(vertices: I64, triangles: I64) -> shapely.Geometry:
    """Return the closed free space that triangles fill."""
    region = shapely.union_all(shapely.polygons(vertices[triangles]))
    shapely.prepare(region)
    return region


def straight_ways(region: shapely.Geometry, starts: I64, ends: I64) -> Bool:
    """Return which segments lie in closed free space."""
    return np.asarray(shapely.covers(region, shapely.linestrings(np.stack([starts, ends], axis=1))))


def graph_of(region: shapely.Geometry, corners: I64) -> Graph:
    """Return for each corner the corners that a straight way leads to, and how long it is."""
    graph: Graph = [[] for _ in corners]
    i, j = np.triu_indices(len(corners), 1)
    free = straight_ways(region, corners[i], corners[j])
    for a, b in zip(i[free].tolist(), j[free].tolist(), strict=True):
        length = math.dist(corners[a], corners[b])
        graph[a].append((b, length))
        graph[b].append((a, length))
    return graph


def shortest(region: shapely.Geometry, corners: I64, graph: Graph, start: I64, goal: I64) -> float:
    """Return the length of the shortest path in closed free space; infinity if there is none."""
    if straight_ways(region, start[None], goal[None])[0]:
        return math.dist(start, goal)
    starts = straight_ways(region, np.broadcast_to(start, corners.shape), corners)
    goals = straight_ways(region, np.broadcast_to(goal, corners.shape), corners)
    queue = [(math.dist(start, corners[i]), i) for i in np.flatnonzero(starts).tolist()]
    heapq.heapify(queue)
    done: set[int] = set()
    best = math.inf
    while queue:
        travelled, corner = heapq.heappop(queue)
        if corner in done:
            continue
        done.add(corner)
        if goals[corner]:
            best = min(best, travelled + math.dist(corners[corner], goal))
        for other, length in graph[corner]:
            if other not in done:
                heapq.heappush(queue, (travelled + length, other))
    return best


def length_of(path: I64) -> float:
    """Return the length of a polyline."""
    return sum(math.dist(a, b) for a, b in zip(path.tolist(), path.tolist()[1:], strict=False))


def parts_of(neighbors: I64) -> list[set[int]]:
    """Return the triangles of each connected part, by merging sets until nothing changes."""
    parts = [{i, *(int(n) for n in row if n >= 0)} for i, row in enumerate(neighbors)]
    merged = True
    while merged:
        merged = False
        apart: list[set[int]] = []
        for part in parts:
            meeting = [other for other in apart if other & part]
            apart = [other for other in apart if not other & part]
            apart.append(part.union(*meeting))
            merged |= bool(meeting)
        parts = apart
    return parts
