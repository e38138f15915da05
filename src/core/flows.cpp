#include "flows.hpp"

#include <limits>
#include <vector>

namespace fleet2d {
namespace {

// A place that has too much mass, or too little, and how much that is.
struct Surplus {
    i64 place;
    f64 mass;
};

// The minimum cost flow from sources to sinks, which grows by shortest paths (Ahuja, Magnanti and Orlin: "Network
// Flows", 1993, chapter 9). Dijkstra's algorithm finds these by reduced costs, the costs less the difference of the
// potentials of both ends, which are never below zero, and zero for edges in use.
class Flow {
public:
    Flow(std::vector<Surplus> sources, std::vector<Surplus> sinks, View<const f64, 2> metres)
        : sources_(std::move(sources)),
          sinks_(std::move(sinks)),
          metres_(metres),
          mass_(sources_.size(), std::vector<f64>(sinks_.size())),
          source_potential_(sources_.size()),
          sink_potential_(sinks_.size()) {}

    // The cost of moving all mass.
    f64 cost() {
        for (std::size_t i = 0; i < sources_.size(); ++i) {
            f64 rest = sources_[i].mass;
            while (rest > NO_MASS && any_lacks()) rest -= push(i, rest);
        }
        f64 sum = 0;
        for (std::size_t i = 0; i < sources_.size(); ++i) {
            for (std::size_t j = 0; j < sinks_.size(); ++j) sum += mass_[i][j] * length(i, j);
        }
        return sum;
    }

private:
    f64 length(std::size_t i, std::size_t j) const { return metres_(sources_[i].place, sinks_[j].place); }

    bool any_lacks() const {
        return std::any_of(sinks_.begin(), sinks_.end(), [](const Surplus& sink) { return sink.mass > NO_MASS; });
    }

    // Send at most `most` mass from a source along a shortest path; returns how much.
    f64 push(std::size_t source, f64 most) {
        distance_.assign(sinks_.size(), std::numeric_limits<f64>::infinity());
        is_open_.assign(sinks_.size(), true);  // whose distance isn't final yet
        parent_.assign(sinks_.size(), source);
        visited_.assign(1, {source, 0, 0.0});
        is_visited_.assign(sources_.size(), false);
        is_visited_[source] = true;
        relax(source, 0.0);
        std::size_t end = nearest();
        for (; !(sinks_[end].mass > NO_MASS); end = nearest()) {
            is_open_[end] = false;
            for (std::size_t i = 0; i < sources_.size(); ++i) {
                if (!(mass_[i][end] > NO_MASS) || is_visited_[i]) continue;
                is_visited_[i] = true;
                visited_.push_back({i, end, distance_[end]});
                relax(i, distance_[end]);
            }
        }
        for (const Visit& visit : visited_) source_potential_[visit.source] += distance_[end] - visit.length;
        for (std::size_t j = 0; j < sinks_.size(); ++j) {
            if (!is_open_[j]) sink_potential_[j] -= distance_[end] - distance_[j];
        }
        return send(source, end, most);
    }

    // The open sink at the least distance; of several the first.
    std::size_t nearest() const {
        std::size_t best = sinks_.size();
        for (std::size_t j = 0; j < sinks_.size(); ++j) {
            if (is_open_[j] && (best == sinks_.size() || distance_[j] < distance_[best])) best = j;
        }
        return best;
    }

    // Shorten the distances of open sinks by the edges of a source, which is `begin` from the start.
    void relax(std::size_t i, f64 begin) {
        begin -= source_potential_[i];
        for (std::size_t j = 0; j < sinks_.size(); ++j) {
            const f64 reduced = begin + length(i, j) - sink_potential_[j];
            if (is_open_[j] && reduced < distance_[j]) {
                distance_[j] = reduced;
                parent_[j] = i;
            }
        }
    }

    // Send mass to a sink along the path found: forward to each sink from its parent, back from the sink by which
    // that parent was visited. Returns how much.
    f64 send(std::size_t source, std::size_t end, f64 most) {
        f64 amount = std::min(most, sinks_[end].mass);
        follow(source, end, [&](std::size_t i, std::size_t j, bool back) {
            if (back) amount = std::min(amount, mass_[i][j]);
        });
        follow(source, end, [&](std::size_t i, std::size_t j, bool back) { mass_[i][j] += back ? -amount : amount; });
        sinks_[end].mass -= amount;
        return amount;
    }

    template <class Edge>
    void follow(std::size_t source, std::size_t end, Edge edge) const {
        std::size_t i = parent_[end];
        edge(i, end, false);
        while (i != source) {
            const std::size_t by =
                std::find_if(visited_.begin(), visited_.end(), [&](const Visit& v) { return v.source == i; })->by;
            edge(i, by, true);
            i = parent_[by];
            edge(i, by, false);
        }
    }

    // A source that a path reaches, by taking mass back from a sink.
    struct Visit {
        std::size_t source, by;
        f64 length;
    };

    std::vector<Surplus> sources_, sinks_;
    View<const f64, 2> metres_;
    std::vector<std::vector<f64>> mass_;  // along each edge, by source and sink
    std::vector<f64> source_potential_, sink_potential_;
    std::vector<f64> distance_;        // of each sink on the present search
    std::vector<std::size_t> parent_;  // the source from which each sink is reached
    std::vector<bool> is_open_, is_visited_;
    std::vector<Visit> visited_;
};

}  // namespace

Array<f64> earth_mover(View<const f64, 2> from, View<const f64, 2> to, View<const f64, 2> metres) {
    auto result = Array<f64>::empty({from.size()});
    for (i64 row = 0; row < from.size(); ++row) {
        std::vector<Surplus> sources, sinks;
        for (i64 place = 0; place < from.shape[1]; ++place) {
            const f64 surplus = from(row, place) - to(row, place);
            if (surplus > NO_MASS) sources.push_back({place, surplus});
            if (surplus < -NO_MASS) sinks.push_back({place, -surplus});
        }
        result[row] = Flow(std::move(sources), std::move(sinks), metres).cost();
    }
    return result;
}

}  // namespace fleet2d
