"""Slow, obvious twins of the route kernels: every corner with every corner, then Dijkstra."""

import math

import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, shortest_path


def region_of(vertices, triangles):
    """Return the closed free space that triangles fill."""
    region = shapely.union_all(shapely.polygons(vertices[triangles]))
    shapely.prepare(region)
    return region


def straight_ways(region, starts, ends):
    """Return which segments lie in closed free space."""
    return np.asarray(shapely.covers(region, shapely.linestrings(np.stack([starts, ends], axis=1))))


def graph_of(region, corners):
    """Return how long the shortest path between every two corners is: float64 (n, n)."""
    i, j = np.triu_indices(len(corners), 1)
    free = straight_ways(region, corners[i], corners[j])
    lengths = np.zeros((len(corners), len(corners)))
    lengths[i[free], j[free]] = np.hypot(*(corners[i] - corners[j])[free].T)
    return shortest_path(lengths, directed=False)


def shortest(region, corners, graph, start, goal):
    """Return the length of the shortest path in closed free space; infinity if there is none."""
    if straight_ways(region, start[None], goal[None])[0]:
        return math.dist(start, goal)
    first, last = (
        np.where(
            straight_ways(region, np.broadcast_to(end, corners.shape), corners),
            np.hypot(*(corners - end).T),
            np.inf,
        )
        for end in (start, goal)
    )
    return float((first[:, None] + graph + last).min())


def length_of(path):
    """Return the length of a polyline."""
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def parts_of(neighbors):
    """Return the number of the connected part of each triangle, by SciPy."""
    triangle, side = np.nonzero(neighbors >= 0)
    links = (np.ones(len(triangle)), (triangle, neighbors[triangle, side]))
    return connected_components(csr_array(links, shape=[len(neighbors)] * 2))[1]
