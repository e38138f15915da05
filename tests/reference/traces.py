"""Slow twin of the traces of evidence, and of the network over places."""

import numpy as np

CAP = 2880.0


class Traces:
    """What the evidence of one person leaves behind in each room; times are in minutes."""

    def __init__(self, rooms):
        """Begin without evidence."""
        self.first, self.last, self.last_time = None, -1, -1e9
        self.seen_at, self.looked_at = np.full((2, rooms), -1e9)
        self.most, self.sum, self.recent_10, self.recent_60 = np.zeros((4, rooms))
        self.seen, self.watched = np.zeros((2, 24, rooms))
        self.moves = np.zeros((rooms, rooms))
        self.gone, self.bins = np.zeros((2, 24))

    def add(self, home, day, minute, watched, seen, unknown, belief):
        """Add a bin; return a row of features for each room, and last for away."""
        time, hour = day * 1440.0 + minute, minute // 60
        self.first = time if self.first is None else self.first
        if seen.any():
            room = int(np.argmax(seen))
            if self.last >= 0 and (room != self.last or time - self.last_time > 1):
                self.moves[self.last, room] += 1
            self.last, self.last_time = room, time
            self.most, self.sum = np.zeros((2, len(seen)))
        empty = np.where(seen > 0, 0, watched)
        self.seen_at[seen > 0] = time
        self.looked_at[watched > 0.5] = time
        self.most = np.maximum(self.most, empty)
        self.sum += empty
        self.recent_10 = self.recent_10 * 0.905 + empty
        self.recent_60 = self.recent_60 * 0.9835 + empty
        self.seen[hour] += seen
        self.watched[hour] += watched
        cover, gap = home.share @ self.most, self._since(time, self.last_time)
        self.gone[hour] += cover > 0.6 and gap > 5
        self.bins[hour] += 1

        total = self.seen.sum(axis=0)
        rate = (total + 1) / (self.watched.sum(axis=0) + 10)
        hours = [hour, (hour - 1) % 24, (hour + 1) % 24]
        near = self.seen[hours].sum(axis=0) + 30 * rate
        near = near / (self.watched[hours].sum(axis=0) + 30)
        moves = np.ones(len(seen))
        distance = np.zeros(len(seen))
        if self.last >= 0:
            moves, distance = self.moves[self.last] + 0.5, home.distance[self.last]
        is_last = np.arange(len(seen)) == self.last
        own = [
            is_last,
            np.log1p(gap) * is_last,
            np.log1p(self._since(time, self.seen_at)),
            seen,
            np.log1p(self._since(time, self.looked_at)),
            self.most,
            np.log1p(self.sum),
            np.log1p(self.recent_10),
            np.log1p(self.recent_60),
            watched,
            np.log(rate / rate.sum()),
            np.log(near / near.sum()),
            total / (total.sum() + 1),
            np.log(moves / moves.sum()) * (self.last >= 0),
            distance,
            unknown,
        ]
        shared = [
            np.log1p(gap),
            cover,
            np.log1p((time - self.first) / 1440),
            seen.any(),
            self.most.max(),
            np.log1p(home.share @ self.sum),
        ]
        rows = np.zeros((len(seen) + 1, 25))
        rows[:-1, :16] = np.transpose(own)
        rows[-1, 16] = (self.gone[hour] + 1) / (self.bins[hour] + 4)
        rows[-1, 17] = (self.gone.sum() + 1) / (self.bins.sum() + 4)
        rows[:, 18:24] = shared
        rows[:, 24] = np.log(np.maximum(belief, 1e-6))
        return rows

    @staticmethod
    def _since(time, before):
        """Return the minutes since an earlier time that count; none where a clock was put back."""
        return np.clip(time - before, 0, CAP)


def place_probabilities(network, places, features):
    """Return the probability of each place, by matrix products."""
    inner = np.maximum(features @ network.first + places, 0)
    context = inner.mean(axis=1) @ network.context + network.bias
    outer = np.maximum(inner @ network.second + context[:, None], 0)
    score = np.exp(outer @ network.score + features[..., -1])
    return score / score.sum(axis=1, keepdims=True)
