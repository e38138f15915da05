"""Which chamber is which room, where a file draws rough boxes over a plan.

The walls say where rooms end; a box says what a chamber is. A box is matched to the chamber that it
outlines, and doesn't reach into others. Where several boxes lie in one chamber, as in an open
plan, they divide it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fleet2d.floorplan.rooms.chambers import Chambers
from fleet2d.floorplan.rooms.regions import Patch
from fleet2d.kernels.chambers import label_frames, spread_labels
from fleet2d.kernels.fields import squared_distance
from fleet2d.kernels.masks import label_parts

I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
Mask = NDArray[np.bool_]

OUTLINES = 0.5
"""A box outlines a chamber if the two boxes overlap by so much of what both cover."""
REACHES = 0.3
"""A box also has what an opening joins to its chamber, if it covers so much of that."""
TOUCHES = 0.15
"""A box of which a smaller part is in the chamber, and that covers less than half of it, only
touches it."""
NOT_FREE, TOO_SMALL = "covers no free space", "covers too little free space"
ONLY_TOUCHES = "only touches rooms"
KEEPS = 0.25
"""Boxes over one another: one that keeps a smaller part of its cells is the same room."""
MIN_ROOM_M2, MIN_ROOM_WIDTH_M = 0.5, 0.4
"""What is smaller, or nowhere as wide, is no room for a label."""
MIN_REST_M2, MIN_REST_WIDTH_M = 2.5, 0.8
"""What no box covers is a room of its own from this size and this width on …"""
REST_SHARE, REST_SHARE_OF_ONE = 0.06, 0.3
"""… and if it is so much of its chamber, in which several labels are, or one."""


@dataclass
class _Block:
    """Chambers that openings join into one, and the boxes that claim each of them."""

    chambers: list[int]
    claims: dict[int, set[int]] = field(default_factory=dict)  # box: chambers


@dataclass(frozen=True)
class Labelled:
    """The rooms that came of boxes.

    Attributes:
        of_cell: For each free cell the number of its box; from the number of boxes on, rooms that
            no box claims; -1 where not free. int32 (rows, columns).
        rests: How many rooms no box claims.
        merged: The box that each box's labels go to: itself, or one that covers it.
        lost: Boxes that are no room, and why, in the order given.
    """

    of_cell: I32
    rests: int
    merged: dict[int, int]
    lost: dict[int, str]


def label_chambers(
    chambers: Chambers, boxes: Sequence[Patch], wide: Sequence[bool], cell: float
) -> Labelled:
    """Divide chambers among boxes.

    Args:
        chambers: The free space, cut at doorways and openings.
        boxes: The free cells of each box.
        wide: Whether each line that the chambers were cut at is an opening, and no doorway.
        cell: Side of a cell [m].
    """
    frames = label_frames(chambers.of_cell, chambers.count)
    claims, lost = _claims(chambers, frames, boxes, wide, cell)
    blocks = _blocks(chambers, claims, wide, cell)
    out = np.full(chambers.of_cell.shape, -1, np.int32)
    for box in sorted(claims, key=lambda b: (-boxes[b].cells, -b)):
        claimed = np.zeros(chambers.count + 1, np.bool_)  # its last entry serves -1
        claimed[list(claims[box])] = True
        window = boxes[box].window
        out[window][boxes[box].mask & claimed[chambers.of_cell[window]]] = box
    merged = {box: box for box in range(len(boxes))}
    following = len(boxes)
    for block in blocks:
        window = _window(frames[block.chambers])
        inside = np.isin(chambers.of_cell[window], block.chambers)
        labels = np.where(inside, out[window], -1).astype(np.int32)
        for box in sorted(block.claims, key=lambda b: (-boxes[b].cells, -b)):
            whole = _seen_in(boxes[box], window, inside)
            _keep_one_piece(labels, box, whole, cell, merged, lost)
        labels, following = _filled(labels, inside, cell, following)
        out[window][inside] = labels[inside]
    return Labelled(out, following - len(boxes), merged, dict(sorted(lost.items())))


# --- Which boxes claim which chambers ------------------------------------------------------------


def _claims(
    chambers: Chambers,
    frames: I64,
    boxes: Sequence[Patch],
    wide: Sequence[bool],
    cell: float,
) -> tuple[dict[int, set[int]], dict[int, str]]:
    """Return the chambers of each box, and the boxes that have none."""
    sizes = np.bincount(chambers.of_cell[chambers.of_cell >= 0], minlength=chambers.count)
    beside: dict[int, set[int]] = {c: set() for c in range(chambers.count)}
    for link in chambers.links:
        if wide[link.line]:
            a, b = link.chambers
            beside[a].add(b)
            beside[b].add(a)
    claims: dict[int, set[int]] = {}
    lost: dict[int, str] = {}
    for number, box in enumerate(boxes):
        counts = np.bincount(chambers.of_cell[box.window][box.mask], minlength=chambers.count)
        if _too_small(box, cell):
            lost[number] = TOO_SMALL if box.cells else NOT_FREE
            continue
        overlap = _overlaps(box.frame, frames)
        overlap[counts < OUTLINES * OUTLINES * sizes] = 0
        best = int(np.argmax(overlap)) if overlap.max() >= OUTLINES else int(np.argmax(counts))
        if counts[best] < TOUCHES * counts.sum() and counts[best] < OUTLINES * sizes[best]:
            lost[number] = ONLY_TOUCHES
            continue
        claims[number] = {best}
        waiting = [best]
        while waiting:
            for near in sorted(beside[waiting.pop()] - claims[number]):
                if counts[near] >= REACHES * sizes[near]:
                    claims[number].add(near)
                    waiting.append(near)
    return claims, lost


def _too_small(box: Patch, cell: float) -> bool:
    row, column, end_row, end_column = box.frame.tolist()
    narrow = min(end_row - row, end_column - column) * cell < MIN_ROOM_WIDTH_M
    return narrow or box.cells * cell**2 < MIN_ROOM_M2


def _overlaps(frame: I64, frames: I64) -> NDArray[np.float64]:
    """Return for each frame what it has in common with one, in parts of what both cover."""
    low, high = np.maximum(frame[:2], frames[:, :2]), np.minimum(frame[2:], frames[:, 2:])
    common = np.clip(high - low, 0, None).prod(axis=1)
    areas = (frames[:, 2:] - frames[:, :2]).prod(axis=1)
    both: NDArray[np.float64] = common / ((frame[2:] - frame[:2]).prod() + areas - common)
    return both


def _blocks(
    chambers: Chambers, claims: dict[int, set[int]], wide: Sequence[bool], cell: float
) -> list[_Block]:
    """Join chambers across openings that part no two labels."""
    owner = list(range(chambers.count))
    sizes = np.bincount(chambers.of_cell[chambers.of_cell >= 0], minlength=chambers.count)
    by_chamber: dict[int, set[int]] = {c: set() for c in owner}
    for box, claimed in claims.items():
        for chamber in claimed:
            by_chamber[chamber].add(box)
    for link in chambers.links:
        a, b = link.chambers
        free = not by_chamber[a] and not by_chamber[b]
        shared = bool(by_chamber[a] & by_chamber[b])
        tiny = any(
            not by_chamber[one] and sizes[one] * cell**2 < MIN_REST_M2 for one in link.chambers
        )
        if wide[link.line] and (free or shared or tiny):
            low, high = sorted((owner[a], owner[b]))
            owner = [low if root == high else root for root in owner]
    blocks = {root: _Block([]) for root in sorted(set(owner))}
    for chamber, root in enumerate(owner):
        blocks[root].chambers.append(chamber)
        for box in by_chamber[chamber]:
            blocks[root].claims.setdefault(box, set()).add(chamber)
    return list(blocks.values())


# --- Dividing a block among its boxes -------------------------------------------------------------


def _window(frames: I64) -> tuple[slice, slice]:
    """Return the rows and columns of all of some frames."""
    (row, column), (end_row, end_column) = frames[:, :2].min(axis=0), frames[:, 2:].max(axis=0)
    return slice(int(row), int(end_row)), slice(int(column), int(end_column))


def _seen_in(box: Patch, window: tuple[slice, slice], inside: Mask) -> Mask:
    """Return the cells of a box that are in a window, bool (rows, columns) of the window."""
    shared = [
        (max(a.start, b.start), max(min(a.stop, b.stop), a.start, b.start))
        for a, b in zip(box.window, window, strict=True)
    ]
    here, there = (
        tuple(
            slice(low - of.start, high - of.start)
            for (low, high), of in zip(shared, by, strict=True)
        )
        for by in (window, box.window)
    )
    seen = np.zeros(inside.shape, np.bool_)
    seen[here] = box.mask[there]
    return seen & inside


def _filled(labels: I32, inside: Mask, cell: float, following: int) -> tuple[I32, int]:
    """Give every cell of a block a room; returns also the number for the next one without a box."""
    claimants = np.flatnonzero(np.bincount(labels[labels >= 0]))
    before = following
    following = _rests(labels, inside, len(claimants), cell, following)
    if len(claimants) == 1 and following == before:
        return np.where(inside, claimants[0], -1).astype(np.int32), following
    if (labels[inside] < 0).any():
        labels = spread_labels(labels, inside)
    while (labels[inside] < 0).any():  # parts that no way across sides joins to a label
        part = label_parts(inside & (labels < 0), False)
        labels[part == 0] = following
        following += 1
    return labels, following


def _keep_one_piece(
    labels: I32, box: int, whole: Mask, cell: float, merged: dict[int, int], lost: dict[int, str]
) -> None:
    """Leave a box its largest piece; or nothing, if that is no room any more."""
    own = labels == box
    if own.any():
        part = label_parts(own, False)
        largest = part == np.argmax(np.bincount(part[own]))
        labels[own & ~largest] = -1
        own = largest
    kept = int(np.count_nonzero(own))
    if kept >= KEEPS * np.count_nonzero(whole) and kept * cell**2 >= MIN_ROOM_M2:
        return
    labels[own] = -1
    over = labels[whole & (labels >= 0)]
    if len(over) and np.count_nonzero(whole):
        merged[box] = int(np.argmax(np.bincount(over)))
    else:
        lost[box] = TOO_SMALL


def _rests(labels: I32, inside: Mask, claimants: int, cell: float, following: int) -> int:
    """Number what of a block no box covers, where it is large enough to be a room."""
    rest = inside & (labels < 0)
    if claimants == 0:
        labels[rest] = following
        return following + 1
    share = REST_SHARE_OF_ONE if claimants == 1 else REST_SHARE
    enough = max(MIN_REST_M2 / cell**2, share * np.count_nonzero(inside))
    if np.count_nonzero(rest) < enough:
        return following
    radius = MIN_REST_WIDTH_M / 2 / cell
    core = squared_distance(np.pad(rest, 1))[1:-1, 1:-1] >= radius**2
    if not core.any():
        return following
    opened = rest & (squared_distance(~core) < radius**2)
    part = label_parts(opened, False)
    sizes = np.bincount(part[opened])
    for number in np.flatnonzero(sizes >= enough):
        labels[part == number] = following
        following += 1
    return following
