#include "obstacles.hpp"

#include <algorithm>
#include <array>
#include <vector>

namespace fleet2d {
namespace {

// A convex shape whose sides are parallel to an axis or a diagonal: least and greatest x, y, x + y and x - y.
struct OctagonShape {
    std::array<i64, 4> low, high;

    bool is_empty() const {
        for (std::size_t k = 0; k < low.size(); ++k) {
            if (low[k] > high[k]) return true;
        }
        const auto [x0, y0, sum0, difference0] = low;
        const auto [x1, y1, sum1, difference1] = high;
        // Twice the x between which each side leaves some y.
        const i64 least = std::max({2 * x0, 2 * (y0 + difference0), 2 * (sum0 - y1), sum0 + difference0});
        const i64 most = std::min({2 * x1, 2 * (y1 + difference1), 2 * (sum1 - y0), sum1 + difference1});
        return least > most;
    }

    // Whether the boxes of two shapes have nothing in common.
    bool is_apart(const OctagonShape& other) const {
        return other.high[0] < low[0] || high[0] < other.low[0] || other.high[1] < low[1] || high[1] < other.low[1];
    }

    OctagonShape common(const OctagonShape& other) const {
        OctagonShape both = *this;
        for (std::size_t k = 0; k < low.size(); ++k) {
            both.low[k] = std::max(low[k], other.low[k]);
            both.high[k] = std::min(high[k], other.high[k]);
        }
        return both;
    }
};

struct Obstacle {
    OctagonShape shape;
    std::size_t part;
    bool is_slanted = false;
};

// The smallest shape that holds an octagon round each of some points.
OctagonShape grown(const std::vector<std::array<i64, 2>>& points, i64 reach, i64 half) {
    OctagonShape shape{};
    for (std::size_t i = 0; i < points.size(); ++i) {
        const auto [x, y] = points[i];
        const std::array<i64, 4> at{x, y, x + y, x - y};
        for (std::size_t k = 0; k < at.size(); ++k) {
            const i64 away = k < 2 ? reach : reach + half;
            shape.low[k] = i == 0 ? at[k] - away : std::min(shape.low[k], at[k] - away);
            shape.high[k] = i == 0 ? at[k] + away : std::max(shape.high[k], at[k] + away);
        }
    }
    return shape;
}

// A piece of a further obstacle that others cover, and with which other pieces it is connected.
struct Contact {
    OctagonShape shape;
    std::size_t part;
    bool is_slanted;
    std::size_t earlier;  // a piece that it is connected with; itself if it is the first
};

// Makes obstacles touch further ones.
class BarredSpace {
public:
    explicit BarredSpace(View<const i64, 2> table) {
        for (i64 i = 0; i < table.size(); ++i) {
            Obstacle obstacle{{}, static_cast<std::size_t>(table(i, 8)), table(i, 9) != 0};
            std::copy_n(table[i].begin(), 4, obstacle.shape.low.begin());
            std::copy_n(table[i].begin() + 4, 4, obstacle.shape.high.begin());
            all_.push_back(obstacle);
        }
    }

    // Add an obstacle; returns how often it may cut the space.
    i64 add(const OctagonShape& shape, bool is_slanted) {
        const std::vector<Contact> contacts = contacts_of(shape);
        i64 cuts = 0;
        for (std::size_t i = 0; i < contacts.size(); ++i) cuts += contacts[i].earlier == i;
        std::vector<std::size_t> parts;
        for (const Contact& contact : contacts) parts.push_back(contact.part);
        std::ranges::sort(parts);
        parts.erase(std::unique(parts.begin(), parts.end()), parts.end());
        const std::size_t part = parts.empty() ? all_.size() : parts.front();
        if (parts.size() > 1) {
            for (Obstacle& obstacle : all_) {
                if (std::ranges::binary_search(parts, obstacle.part)) obstacle.part = part;
            }
        }
        all_.push_back({shape, part, is_slanted});
        return cuts - static_cast<i64>(parts.size());
    }

    Array<i64, 2> table() const {
        auto rows = Array<i64, 2>::empty({static_cast<i64>(all_.size()), OBSTACLE_COLUMNS});
        for (i64 i = 0; i < rows.size(); ++i) {
            const Obstacle& obstacle = all_[static_cast<std::size_t>(i)];
            std::ranges::copy(obstacle.shape.low, rows[i].begin());
            std::ranges::copy(obstacle.shape.high, rows[i].begin() + 4);
            rows(i, 8) = static_cast<i64>(obstacle.part);
            rows(i, 9) = obstacle.is_slanted;
        }
        return rows;
    }

private:
    std::vector<Contact> contacts_of(const OctagonShape& shape) const {
        std::vector<Contact> contacts;
        for (const Obstacle& obstacle : all_) {
            if (shape.is_apart(obstacle.shape)) continue;  // most are
            const OctagonShape both = shape.common(obstacle.shape);
            if (both.is_empty()) continue;
            contacts.push_back({both, obstacle.part, obstacle.is_slanted, contacts.size()});
        }
        const auto first_of = [&](std::size_t i) {
            while (contacts[i].earlier != i) i = contacts[i].earlier;
            return i;
        };
        for (std::size_t i = 0; i < contacts.size(); ++i) {
            for (std::size_t j = 0; j < i; ++j) {
                // What a slanted wall takes is not known, so it connects nothing.
                if (contacts[i].is_slanted || contacts[j].is_slanted) continue;
                if (first_of(i) == first_of(j) || contacts[i].shape.common(contacts[j].shape).is_empty()) continue;
                const auto [earlier, later] = std::minmax({first_of(i), first_of(j)});
                contacts[later].earlier = earlier;
            }
        }
        return contacts;
    }

    std::vector<Obstacle> all_;
};

}  // namespace

Array<i64, 2> wall_obstacles(View<const i64, 2> corners, View<const i64> ring_of, i64 reach, i64 half) {
    BarredSpace space{{}};
    for (i64 i = 0; i + 1 < corners.size(); ++i) {
        if (ring_of[i] != ring_of[i + 1]) continue;
        const std::array<i64, 2> from{corners(i, 0), corners(i, 1)}, to{corners(i + 1, 0), corners(i + 1, 1)};
        space.add(grown({from, to}, reach, half), from[0] != to[0] && from[1] != to[1]);
    }
    return space.table();
}

std::pair<Array<i64, 2>, i64> add_obstacles(View<const i64, 2> obstacles, View<const i64, 2> boxes, i64 reach,
                                            i64 half) {
    BarredSpace space(obstacles);
    i64 cuts = 0;
    for (i64 i = 0; i < boxes.size(); ++i) {
        const i64 x0 = boxes(i, 0), y0 = boxes(i, 1), x1 = boxes(i, 2), y1 = boxes(i, 3);
        cuts += space.add(grown({{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}, reach, half), false);
    }
    return {space.table(), cuts};
}

}  // namespace fleet2d
