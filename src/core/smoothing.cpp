#include "smoothing.hpp"

namespace fleet2d {
namespace {

// The sum of products, in order.
f64 dot(View<const f64> a, View<const f64> b, Range range) {
    f64 sum = 0.0;
    for (i64 p = range.begin; p < range.end; ++p) sum += a[p] * b[p];
    return sum;
}

void multiply(f64 factor, View<const f64> from, View<f64> to) {
    for (i64 p = 0; p < from.size(); ++p) to[p] = factor * from[p];
}

// Goes through filtered stretches from the last to the first.
class BackwardPass {
public:
    BackwardPass(const StayModel& model, const Stretches& stretches, const Filtered& filtered, const Moments& moments)
        : model_(model),
          stretches_(stretches),
          filtered_(filtered),
          moments_(moments),
          rooms_(model.rooms()),
          stages_(model.stages()),
          ahead_in_view_(Array<f64, 2>::empty({stages_, model.patches()})),
          ahead_hidden_(Array<f64, 2>::empty({stages_, model.patches()})),
          in_view_(Array<f64, 2>::empty({stages_, model.patches()})),
          hidden_(Array<f64, 2>::empty({stages_, model.patches()})),
          comes_(Array<f64, 2>::empty({stages_, model.patches()})),
          sums_(Array<f64>::empty({model.nodes()})),
          arrival_(Array<f64>::empty({rooms_})),
          go_(Array<f64>::empty({model.nodes()})),
          comers_(Array<f64>::empty({rooms_})) {}

    // Begin after the last stretch; `end` (stages, patches) is the filtered probability, `future` as for `smooth`.
    void begin(View<const f64, 2> end, View<const f64, 2> future) {
        f64 total = 0.0;
        for (i64 stage = 0; stage < stages_; ++stage) {
            for (i64 p = 0; p < model_.patches(); ++p) total += end(stage, p) * future(stage, p);
        }
        for (i64 stage = 0; stage < stages_; ++stage) {
            for (i64 p = 0; p < model_.patches(); ++p) {
                ahead_in_view_(stage, p) = ahead_hidden_(stage, p) = future(stage, p) / total;
            }
        }
    }

    // Go back over a stretch; `places` (rooms,), zeros, become P(room) in it.
    void step(i64 t, View<f64> places) {
        locate_person(t, places);
        weigh_states(t);
        leave(t);
        for (i64 stage = 0; stage < stages_; ++stage) {
            arrive(t, stage);
            stay(t, stage, stage);
            if (stage + 1 < stages_) stay(t, stage, stage + 1);
        }
    }

    // The likelihood of all later evidence for each hidden state, largest 1: (stages, patches).
    Array<f64, 2> ahead() const {
        f64 largest = ahead_hidden_[0][0];
        for (i64 stage = 0; stage < stages_; ++stage) {
            for (const f64 value : ahead_hidden_[stage]) largest = std::max(largest, value);
        }
        auto result = Array<f64, 2>::empty({stages_, model_.patches()});
        for (i64 stage = 0; stage < stages_; ++stage) {
            for (i64 p = 0; p < model_.patches(); ++p) result(stage, p) = ahead_hidden_[stage][p] / largest;
        }
        return result;
    }

private:
    // P(room) in a stretch.
    void locate_person(i64 t, View<f64> places) {
        const View<const bool> visible = filtered_.visible[t + 1];
        for (i64 stage = 0; stage < stages_; ++stage) {
            const View<const f64> in_view = filtered_.in_view[t + 1][stage], hidden = filtered_.hidden[t + 1][stage];
            const View<const f64> if_in_view = ahead_in_view_[stage], if_hidden = ahead_hidden_[stage];
            for (i64 room = 0; room < rooms_; ++room) {
                const Range range = model_.patches_of(room);
                f64 sum = 0.0;
                if (visible[room]) {
                    for (i64 p = range.begin; p < range.end; ++p) {
                        sum += in_view[p] * if_in_view[p] + hidden[p] * if_hidden[p];
                    }
                } else {
                    sum = dot(hidden, if_hidden, range);
                }
                sums_[node(room, stage)] = sum;
            }
        }
        f64 total = 0.0;
        for (i64 k = 0; k < model_.nodes(); ++k) {
            places[k / stages_] += sums_[k];
            total += sums_[k];
        }
        for (f64& share : places) share /= total;
    }

    // The likelihood of a stretch and of all later ones for each state, and for coming to each patch; scaled so that
    // products with the filtered probability sum to one.
    void weigh_states(i64 t) {
        const View<const f64> likely = filtered_.likely[t];
        const f64 scale = filtered_.scale[t];
        for (i64 stage = 0; stage < stages_; ++stage) {
            multiply(likely[0] * scale, ahead_in_view_[stage], in_view_[stage]);
            multiply(likely[1] * scale, ahead_hidden_[stage], hidden_[stage]);
        }
        weigh_sightings(stretches_, t, likely, in_view_, hidden_);

        const View<const u8> view = stretches_.shown(t);
        const View<const bool> visible = filtered_.visible[t + 1];
        for (i64 stage = 0; stage < stages_; ++stage) {
            const View<const f64> in_view = in_view_[stage], hidden = hidden_[stage];
            const View<f64> comes = comes_[stage];
            std::copy(hidden.begin(), hidden.end(), comes.begin());
            for (i64 room = 0; room < rooms_; ++room) {
                if (!visible[room]) continue;
                const auto [begin, end] = model_.patches_of(room);
                for (i64 p = begin; p < end; ++p) {
                    const f64 shown = part_in_view(view[p]);
                    comes[p] = shown * in_view[p] + (1.0 - shown) * hidden[p];
                }
            }
        }
    }

    // Add the expected moments of leaving rooms and of changes of patch. Sets `go_` and `comers_`.
    void leave(i64 t) {
        const i64 length = filtered_.transitions.length[t];
        const View<const f64> mass = filtered_.mass[t], hop = filtered_.transitions.hop[length];
        const View<const f64, 2> chance = filtered_.transitions.leave[length];
        const f64 bins = static_cast<f64>(stretches_.bins[t]), halfway = until_event(bins);
        for (i64 room = 0; room < rooms_; ++room) {
            arrival_[room] = dot(model_.spread, comes_[0], model_.patches_of(room));
            comers_[room] = 0.0;
        }
        for (i64 room = 0; room < rooms_; ++room) {
            for (i64 stage = 0; stage < stages_; ++stage) {
                const i64 k = node(room, stage);
                const f64 left = leave_node(rooms_, mass[k], chance[k].data, arrival_.data(), comers_.data(),
                                            moments_.exits[k].data);
                const f64 drawn =
                    stage == 0 ? arrival_[room] : dot(model_.spread, comes_[stage], model_.patches_of(room));
                const f64 moved = hop[k] * drawn;
                go_[k] = left + moved;
                moments_.time[k] += mass[k] * (halfway * left + bins * moved);
                moments_.moves[room] += mass[k] * moved;
                moments_.rests[room] += mass[k] * (halfway - 1.0) * moved;
            }
        }
    }

    // Add the expected exits of one node; returns the likelihood of the later evidence given an exit.
    static f64 leave_node(i64 rooms, f64 mass, const f64* chance, const f64* arrival, f64* __restrict comers,
                          f64* __restrict exits) {
        f64 left = 0.0;
        for (i64 room = 0; room < rooms; ++room) {
            left += chance[room] * arrival[room];
            comers[room] += mass * chance[room];
            exits[room] += mass * chance[room] * arrival[room];
        }
        return left;
    }

    // Add the expected arrivals at patches in a stretch.
    void arrive(i64 t, i64 stage) {
        const View<const f64> mass = filtered_.mass[t];
        const View<const f64> hop = filtered_.transitions.hop[filtered_.transitions.length[t]];
        const View<const f64> comes = comes_[stage];
        for (i64 room = 0; room < rooms_; ++room) {
            const i64 k = node(room, stage);
            const auto [begin, end] = model_.patches_of(room);
            const f64 came = stage == 0 ? hop[k] * mass[k] + comers_[room] : hop[k] * mass[k];
            arrive_room(end - begin, came, model_.spread.data + begin, comes.data + begin,
                        moments_.arrivals.data + begin);
        }
    }

    static void arrive_room(i64 patches, f64 came, const f64* spread, const f64* comes, f64* __restrict arrivals) {
        for (i64 p = 0; p < patches; ++p) arrivals[p] += came * spread[p] * comes[p];
    }

    // Update the likelihoods of a stage for persons who stay in their patch, in stage `then`, which is the same stage
    // or the next one; and add the expected moments.
    void stay(i64 t, i64 stage, i64 then) {
        const i64 length = filtered_.transitions.length[t];
        const f64 bins = static_cast<f64>(stretches_.bins[t]);
        const View<const f64> rest = filtered_.transitions.rest[length];
        const View<const f64, 2> leave = filtered_.transitions.leave[length];
        const View<const f64> was = filtered_.hidden[t][stage], comes = comes_[then];
        const View<f64> to = ahead_hidden_[stage];
        const View<const bool> visible = filtered_.visible[t];
        for (i64 room = 0; room < rooms_; ++room) {
            const i64 k = node(room, stage);
            const auto [begin, end] = model_.patches_of(room);
            const f64 chance = then == stage ? rest[k] : leave(k, model_.next_stage());
            const f64 total = visible[room] ? stay_visible(t, stage, then, room, chance)
                                            : stay_hidden(end - begin, chance, then == stage, go_[k],
                                                          comes.data + begin, was.data + begin, to.data + begin);
            if (then == stage) {
                moments_.time[k] += bins * total;
                moments_.rests[room] += bins * total;
            } else {
                moments_.time[k] += until_event(bins) * total;
                moments_.exits(k, model_.next_stage()) += total;
            }
        }
    }

    // The same for a room that was visible; returns the probability of staying.
    f64 stay_visible(i64 t, i64 stage, i64 then, i64 room, f64 chance) {
        const View<const f64> was_in_view = filtered_.in_view[t][stage], was_hidden = filtered_.hidden[t][stage];
        const View<f64> to_in_view = ahead_in_view_[stage], to_hidden = ahead_hidden_[stage];
        const View<const f64> in_view = in_view_[then], hidden = hidden_[then], comes = comes_[then];
        const View<const bool> same = filtered_.same[t];
        const f64 go = go_[node(room, stage)];
        const auto [begin, end] = model_.patches_of(room);
        f64 total = 0.0;
        for (i64 p = begin; p < end; ++p) {
            const f64 if_in_view = chance * (same[p] ? in_view[p] : comes[p]);
            const f64 if_hidden = chance * (same[p] ? hidden[p] : comes[p]);
            to_in_view[p] = (then == stage ? go : to_in_view[p]) + if_in_view;
            to_hidden[p] = (then == stage ? go : to_hidden[p]) + if_hidden;
            total += was_in_view[p] * if_in_view + was_hidden[p] * if_hidden;
        }
        return total;
    }

    // The same for a room that wasn't visible, where a hidden person's view is drawn anew.
    static f64 stay_hidden(i64 patches, f64 chance, bool first, f64 go, const f64* comes, const f64* was,
                           f64* __restrict to) {
        f64 total = 0.0;
        for (i64 p = 0; p < patches; ++p) {
            const f64 likely = chance * comes[p];
            to[p] = (first ? go : to[p]) + likely;
            total += was[p] * likely;
        }
        return total;
    }

    // Mean number of bins until an event within a stretch.
    static f64 until_event(f64 bins) { return 0.5 * (bins + 1); }

    i64 node(i64 room, i64 stage) const { return room * stages_ + stage; }

    const StayModel& model_;
    const Stretches& stretches_;
    const Filtered& filtered_;
    const Moments& moments_;
    const i64 rooms_, stages_;
    // The likelihood of all evidence after a stretch for each state, (stages, patches). In view only where visible.
    Array<f64, 2> ahead_in_view_, ahead_hidden_;
    // The likelihood of a stretch and all later ones for each state, and for coming to each patch, (stages, patches).
    Array<f64, 2> in_view_, hidden_, comes_;
    Array<f64> sums_;     // (nodes,)
    Array<f64> arrival_;  // (rooms,) likelihood of a stretch and all later ones given an arrival in the room
    Array<f64> go_;       // (nodes,) likelihood of the later evidence given an exit or a change of patch
    Array<f64> comers_;   // (rooms,) probability of coming from another room
};

}  // namespace

Smoothed smooth(const StayModel& model, const Stretches& stretches, View<const f64, 2> prior, View<const f64, 2> future,
                const Moments& moments) {
    const i64 count = stretches.size(), stages = model.stages(), patches = model.patches();
    auto now = Array<f64, 3>::zeros({2, stages, patches});
    for (i64 stage = 0; stage < stages; ++stage) {
        std::copy(prior[stage].begin(), prior[stage].end(), now[1][stage].begin());
    }
    const Filtered filtered = filter_stays(model, stretches, now, Array<i64>::filled({patches}, -1));

    Smoothed result{Array<f64, 2>::zeros({count, model.rooms()}), Array<f64, 2>::empty({stages, patches}), {}};
    for (i64 stage = 0; stage < stages; ++stage) {
        const View<const f64> in_view = filtered.in_view[count][stage], hidden = filtered.hidden[count][stage];
        for (i64 p = 0; p < patches; ++p) result.end(stage, p) = in_view[p] + hidden[p];
    }
    BackwardPass pass(model, stretches, filtered, moments);
    pass.begin(result.end, future);
    for (i64 t = count - 1; t >= 0; --t) pass.step(t, result.places[t]);
    result.ahead = pass.ahead();
    return result;
}

}  // namespace fleet2d
