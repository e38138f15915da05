"""Slow twin of the traces of evidence, and of the network over places."""

import math

import numpy as np

CAP = 2880.0


def since(time, before):
    """Return the minutes since an earlier time that count; none where a clock was put back."""
    return min(max(time - before, 0.0), CAP)


class Traces:
    """What the evidence of one person leaves behind in each room."""

    def __init__(self, rooms):
        """Begin without evidence."""
        self.rooms = rooms
        self.first = None
        self.last, self.last_time = -1, -1e9
        self.seen_at, self.looked_at = [-1e9] * rooms, [-1e9] * rooms
        self.most, self.sum = [0.0] * rooms, [0.0] * rooms
        self.recent_10, self.recent_60 = [0.0] * rooms, [0.0] * rooms
        self.seen = [[0.0] * rooms for _ in range(24)]
        self.watched = [[0.0] * rooms for _ in range(24)]
        self.moves = [[0.0] * rooms for _ in range(rooms)]
        self.gone, self.bins = [0] * 24, [0] * 24

    def add(self, home, day, minute, watched, seen, unknown, belief):
        """Add a bin; return a row of features for each room, and last for away."""
        time, hour, rooms = day * 1440.0 + minute, minute // 60, range(self.rooms)
        self.first = time if self.first is None else self.first
        if any(share > 0 for share in seen):
            room = max(rooms, key=lambda r: (seen[r], -r))
            if self.last >= 0 and (room != self.last or time - self.last_time > 1):
                self.moves[self.last][room] += 1
            self.last, self.last_time = room, time
            self.most, self.sum = [0.0] * self.rooms, [0.0] * self.rooms
        empty = [0.0 if seen[r] > 0 else float(watched[r]) for r in rooms]
        for r in rooms:
            self.seen_at[r] = time if seen[r] > 0 else self.seen_at[r]
            self.looked_at[r] = time if watched[r] > 0.5 else self.looked_at[r]
            self.most[r], self.sum[r] = max(self.most[r], empty[r]), self.sum[r] + empty[r]
            self.recent_10[r] = self.recent_10[r] * 0.905 + empty[r]
            self.recent_60[r] = self.recent_60[r] * 0.9835 + empty[r]
            self.seen[hour][r] += seen[r]
            self.watched[hour][r] += watched[r]
        cover = sum(home.share[r] * self.most[r] for r in rooms)
        gap = since(time, self.last_time)
        self.gone[hour] += cover > 0.6 and gap > 5
        self.bins[hour] += 1
        return self._rows(home, hour, time, gap, cover, watched, seen, unknown, belief)

    def _rows(self, home, hour, time, *rest):
        gap, cover, watched, seen, unknown, belief = rest
        rooms = range(self.rooms)
        total = [sum(self.seen[h][r] for h in range(24)) for r in rooms]
        rate = [(total[r] + 1) / (sum(self.watched[h][r] for h in range(24)) + 10) for r in rooms]
        hours = [hour, (hour - 1) % 24, (hour + 1) % 24]
        near = [
            (sum(self.seen[h][r] for h in hours) + 30 * rate[r])
            / (sum(self.watched[h][r] for h in hours) + 30)
            for r in rooms
        ]
        moves = [self.moves[self.last][r] + 0.5 for r in rooms] if self.last >= 0 else []
        shared = [
            math.log1p(gap),
            cover,
            math.log1p((time - self.first) / 1440),
            float(any(share > 0 for share in seen)),
            max(self.most),
            math.log1p(sum(home.share[r] * self.sum[r] for r in rooms)),
        ]
        own = [
            [
                float(r == self.last),
                math.log1p(gap) if r == self.last else 0.0,
                math.log1p(since(time, self.seen_at[r])),
                seen[r],
                math.log1p(since(time, self.looked_at[r])),
                self.most[r],
                math.log1p(self.sum[r]),
                math.log1p(self.recent_10[r]),
                math.log1p(self.recent_60[r]),
                watched[r],
                math.log(rate[r] / sum(rate)),
                math.log(near[r] / sum(near)),
                total[r] / (sum(total) + 1),
                math.log(moves[r] / sum(moves)) if moves else 0.0,
                home.distance[self.last][r] if moves else 0.0,
                float(unknown[r]),
                0.0,
                0.0,
            ]
            for r in rooms
        ]
        gone = (self.gone[hour] + 1) / (self.bins[hour] + 4)
        gone_ever = (sum(self.gone) + 1) / (sum(self.bins) + 4)
        own.append([0.0] * 16 + [gone, gone_ever])
        return [
            [*row, *shared, math.log(max(belief[place], 1e-6))] for place, row in enumerate(own)
        ]


def place_probabilities(network, places, features):
    """Return the probability of each place, by matrix products."""
    inner = np.maximum(features @ network.first + places, 0)
    context = inner.mean(axis=1) @ network.context + network.bias
    outer = np.maximum(inner @ network.second + context[:, None], 0)
    score = np.exp(outer @ network.score + features[..., -1])
    return score / score.sum(axis=1, keepdims=True)
