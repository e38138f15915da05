#include "stays.hpp"

#include <vector>

#include "lattice.hpp"

namespace fleet2d {
namespace {

// A base to a whole power, by multiplications.
f64 whole_power(f64 base, i64 exponent) {
    f64 result = 1.0;
    for (; exponent > 0; exponent >>= 1) {
        if (exponent & 1) result *= base;
        base *= base;
    }
    return result;
}

Transitions transitions_of(const StayModel& model, View<const i64> bins) {
    std::vector<i64> lengths(bins.begin(), bins.end());
    std::sort(lengths.begin(), lengths.end());
    lengths.erase(std::unique(lengths.begin(), lengths.end()), lengths.end());
    const i64 count = static_cast<i64>(lengths.size()), nodes = model.nodes(), columns = model.follow.shape[1];
    Transitions result;
    result.length = Array<i64>::empty({bins.size()});
    result.over = Array<f64, 2>::empty({count, nodes});
    result.rest = Array<f64, 2>::empty({count, nodes});
    result.hop = Array<f64, 2>::empty({count, nodes});
    result.leave = Array<f64, 3>::empty({count, nodes, columns});
    result.missed = Array<f64>::empty({count});
    for (i64 t = 0; t < bins.size(); ++t) {
        result.length[t] = std::lower_bound(lengths.begin(), lengths.end(), bins[t]) - lengths.begin();
    }
    for (i64 i = 0; i < count; ++i) {
        const i64 length = lengths[static_cast<std::size_t>(i)];
        for (i64 k = 0; k < nodes; ++k) {
            const f64 kept = whole_power(model.stay[k], length);
            const f64 moved = 1.0 - whole_power(1.0 - model.restless[k / model.stages()], length);
            result.over(i, k) = 1.0 - kept;
            result.rest(i, k) = kept * (1.0 - moved);
            result.hop(i, k) = kept * moved;
            for (i64 j = 0; j < columns; ++j) result.leave(i, k, j) = (1.0 - kept) * model.follow(k, j);
        }
        result.missed[i] = std::max(whole_power(1.0 - model.detection, length), NEVER_SURE);
    }
    return result;
}

// The sources of the probability of one stage of stays in a room.
struct Flow {
    f64 came;    // probability of coming to the room, or of changing patch in it
    f64 rest;    // probability of staying in the stage and in the patch
    f64 onward;  // probability of coming from the previous stage; 0 if there is none
};

// The probability of the hidden states of a room that isn't visible and wasn't, (patches,) arrays: `was` and `now`
// of the stage before and after a stretch, `last` of the stage before it, nullptr if there is none.
void flow_hidden(Flow flow, f64 likely, i64 patches, const f64* spread, const f64* was, const f64* last,
                 f64* __restrict now) {
    if (last == nullptr) {
        for (i64 p = 0; p < patches; ++p) now[p] = (flow.came * spread[p] + flow.rest * was[p]) * likely;
    } else {
        for (i64 p = 0; p < patches; ++p) {
            now[p] = (flow.came * spread[p] + (flow.rest * was[p] + flow.onward * last[p])) * likely;
        }
    }
}

// Goes through stretches from the first to the last.
class ForwardPass {
public:
    ForwardPass(const StayModel& model, const Stretches& stretches, Filtered& filtered)
        : model_(model),
          stretches_(stretches),
          filtered_(filtered),
          rooms_(model.rooms()),
          stages_(model.stages()),
          comers_(Array<f64>::empty({rooms_})) {}

    // Advance over one stretch.
    void step(i64 t) {
        const f64 weight = stretches_.begin[t + 1] > stretches_.begin[t] ? FALSE_ALARM : 1.0;
        filtered_.likely(t, 0) = weight * filtered_.transitions.missed[filtered_.transitions.length[t]];
        filtered_.likely(t, 1) = weight;
        count_comers(t);
        for (i64 room = 0; room < rooms_; ++room) filtered_.visible(t + 1, room) = becomes_visible(t, room);
        for (i64 stage = 0; stage < stages_; ++stage) predict(t, stage);
        weigh_sightings(stretches_, t, filtered_.likely[t], filtered_.in_view[t + 1], filtered_.hidden[t + 1]);
        sum_nodes(t + 1);
        normalize(t);
    }

private:
    // The probability of coming to each room from a stage that ends.
    void count_comers(i64 t) {
        const View<const f64> mass = filtered_.mass[t];
        const View<const f64> over = filtered_.transitions.over[filtered_.transitions.length[t]];
        const View<f64> comers = comers_;
        std::fill(comers.begin(), comers.end(), 0.0);
        for (i64 k = 0; k < model_.nodes(); ++k) {
            const f64 leaving = mass[k] * over[k];
            const View<const f64> follow = model_.follow[k];
            for (i64 room = 0; room < comers.size(); ++room) comers[room] += leaving * follow[room];
        }
    }

    // Whether the person may be in view in a room after a stretch.
    bool becomes_visible(i64 t, i64 room) const {
        const auto [begin, end] = model_.patches_of(room);
        const View<const u8> shown = stretches_.shown(t);
        for (i64 p = begin; p < end; ++p) {
            if (shown[p] > 0) return true;
        }
        if (!filtered_.visible[t][room]) return false;
        // Without a view `in_view` becomes 0; but the initial distribution may have states in view.
        const View<const bool> same = filtered_.same[t];
        for (i64 stage = 0; stage < stages_; ++stage) {
            const View<const f64> in_view = filtered_.in_view[t][stage];
            for (i64 p = begin; p < end; ++p) {
                if (same[p] && in_view[p] != 0.0) return true;
            }
        }
        return false;
    }

    // The probability of the states of a stage after a stretch without sightings.
    void predict(i64 t, i64 stage) {
        const i64 length = filtered_.transitions.length[t];
        const View<const f64> mass = filtered_.mass[t];
        const View<const f64> rest = filtered_.transitions.rest[length], hop = filtered_.transitions.hop[length];
        const View<const f64, 2> leave = filtered_.transitions.leave[length];
        const View<const bool> before = filtered_.visible[t], after = filtered_.visible[t + 1];
        const f64* was = filtered_.hidden[t][stage].data;
        const f64* last = stage == 0 ? nullptr : filtered_.hidden[t][stage - 1].data;
        f64* now = filtered_.hidden[t + 1][stage].data;
        const f64 likely = filtered_.likely(t, 1);
        for (i64 room = 0; room < rooms_; ++room) {
            const auto [begin, end] = model_.patches_of(room);
            const i64 k = node(room, stage);
            Flow flow{hop[k] * mass[k], rest[k], 0.0};
            if (stage == 0) {
                flow.came += comers_[room];
            } else {
                flow.onward = leave(k - 1, model_.next_stage());
            }
            if (before[room] || after[room]) {
                flow_visible(t, stage, room, flow);
            } else {
                flow_hidden(flow, likely, end - begin, model_.spread.data + begin, was + begin,
                            last == nullptr ? nullptr : last + begin, now + begin);
            }
        }
    }

    // The same for a room that is visible, or was.
    void flow_visible(i64 t, i64 stage, i64 room, Flow flow) {
        const i64 earlier = std::max(stage - 1, i64{0});  // flow.onward is 0 at the first stage
        const View<const f64, 2> in_view = filtered_.in_view[t], hidden = filtered_.hidden[t];
        const View<const f64> was_in_view = in_view[stage], was_hidden = hidden[stage];
        const View<const f64> last_in_view = in_view[earlier], last_hidden = hidden[earlier];
        const View<f64> now_in_view = filtered_.in_view[t + 1][stage], now_hidden = filtered_.hidden[t + 1][stage];
        const View<const u8> view = stretches_.shown(t);
        const View<const bool> same = filtered_.same[t];
        const View<const f64> likely = filtered_.likely[t];
        const auto [begin, end] = model_.patches_of(room);
        for (i64 p = begin; p < end; ++p) {
            const f64 shown = part_in_view(view[p]);
            const f64 stay_in_view = flow.rest * was_in_view[p] + flow.onward * last_in_view[p];
            const f64 stay_hidden = flow.rest * was_hidden[p] + flow.onward * last_hidden[p];
            const f64 drawn = flow.came * model_.spread[p] + (same[p] ? 0.0 : stay_in_view + stay_hidden);
            now_in_view[p] = (shown * drawn + (same[p] ? stay_in_view : 0.0)) * likely[0];
            now_hidden[p] = ((1.0 - shown) * drawn + (same[p] ? stay_hidden : 0.0)) * likely[1];
        }
    }

    // Sum the states of each node.
    void sum_nodes(i64 t) {
        const View<const bool> visible = filtered_.visible[t];
        const View<f64> mass = filtered_.mass[t];
        for (i64 stage = 0; stage < stages_; ++stage) {
            const View<const f64> in_view = filtered_.in_view[t][stage], hidden = filtered_.hidden[t][stage];
            for (i64 room = 0; room < rooms_; ++room) {
                const auto [begin, end] = model_.patches_of(room);
                f64 sum = 0.0;
                if (visible[room]) {
                    for (i64 p = begin; p < end; ++p) sum += in_view[p] + hidden[p];
                } else {
                    for (i64 p = begin; p < end; ++p) sum += hidden[p];
                }
                mass[node(room, stage)] = sum;
            }
        }
    }

    // Normalize the distribution after a stretch.
    void normalize(i64 t) {
        const View<const bool> visible = filtered_.visible[t + 1];
        const View<f64> mass = filtered_.mass[t + 1];
        f64 total = 0.0;
        for (const f64 part : mass) total += part;
        const f64 scale = 1.0 / total;
        filtered_.scale[t] = scale;
        for (f64& part : mass) part *= scale;
        for (i64 stage = 0; stage < stages_; ++stage) {
            for (f64& part : filtered_.hidden[t + 1][stage]) part *= scale;
            const View<f64> in_view = filtered_.in_view[t + 1][stage];
            for (i64 room = 0; room < rooms_; ++room) {
                if (!visible[room]) continue;
                const auto [begin, end] = model_.patches_of(room);
                for (f64& part : in_view.slice(begin, end)) part *= scale;
            }
        }
    }

    i64 node(i64 room, i64 stage) const { return room * stages_ + stage; }

    const StayModel& model_;
    const Stretches& stretches_;
    Filtered& filtered_;
    const i64 rooms_, stages_;
    Array<f64> comers_;  // (rooms,)
};

// Set the distribution before the first stretch.
void begin(const StayModel& model, View<const f64, 3> now, Filtered& filtered) {
    for (i64 stage = 0; stage < model.stages(); ++stage) {
        const View<const f64> in_view = now[0][stage], hidden = now[1][stage];
        std::copy(in_view.begin(), in_view.end(), filtered.in_view[0][stage].begin());
        std::copy(hidden.begin(), hidden.end(), filtered.hidden[0][stage].begin());
        for (i64 room = 0; room < model.rooms(); ++room) {
            const auto [begin, end] = model.patches_of(room);
            for (i64 p = begin; p < end; ++p) {
                filtered.mass(0, model.node(room, stage)) += in_view[p] + hidden[p];
                filtered.visible(0, room) |= in_view[p] != 0.0;
            }
        }
    }
}

// Set whether the part of each patch in view is the same as before.
void compare_views(const Stretches& stretches, View<const i64> shown_before, View<bool, 2> same) {
    for (i64 t = 0; t < same.size(); ++t) {
        const View<const u8> now = stretches.shown(t);
        const View<bool> row = same[t];
        if (t == 0) {
            for (i64 p = 0; p < row.size(); ++p) row[p] = now[p] == shown_before[p];
        } else if (stretches.view[t] == stretches.view[t - 1]) {
            std::fill(row.begin(), row.end(), true);
        } else {
            const View<const u8> before = stretches.shown(t - 1);
            for (i64 p = 0; p < row.size(); ++p) row[p] = now[p] == before[p];
        }
    }
}

}  // namespace

void weigh_sightings(const Stretches& stretches, i64 t, View<const f64> likely, View<f64, 2> in_view,
                     View<f64, 2> hidden) {
    for (i64 i = stretches.begin[t]; i < stretches.begin[t + 1]; ++i) {
        const i64 p = stretches.patch[i];
        const bool shown = stretches.shown(t)[p] > 0;
        const View<f64, 2> states = shown ? in_view : hidden;
        const f64 factor = 1.0 + stretches.share[i] / likely[shown ? 0 : 1];
        for (i64 stage = 0; stage < states.size(); ++stage) states(stage, p) *= factor;
    }
}

Filtered filter_stays(const StayModel& model, const Stretches& stretches, View<const f64, 3> now,
                      View<const i64> shown) {
    const i64 count = stretches.size(), stages = model.stages(), patches = model.patches();
    Filtered filtered;
    filtered.transitions = transitions_of(model, stretches.bins);
    filtered.in_view = Array<f64, 3>::zeros({count + 1, stages, patches});
    filtered.hidden = Array<f64, 3>::empty({count + 1, stages, patches});
    filtered.visible = Array<bool, 2>::zeros({count + 1, model.rooms()});
    filtered.mass = Array<f64, 2>::zeros({count + 1, model.nodes()});
    filtered.likely = Array<f64, 2>::empty({count, 2});
    filtered.scale = Array<f64>::empty({count});
    filtered.same = Array<bool, 2>::empty({count, patches});
    begin(model, now, filtered);
    compare_views(stretches, shown, filtered.same);
    ForwardPass pass(model, stretches, filtered);
    for (i64 t = 0; t < count; ++t) pass.step(t);
    return filtered;
}

Array<f64, 2> follow(const StayModel& model, const Stretches& stretches, View<f64, 3> now, View<i64> shown) {
    const i64 count = stretches.size();
    const Filtered filtered = filter_stays(model, stretches, now, shown);
    auto places = Array<f64, 2>::zeros({count, model.rooms()});
    for (i64 t = 0; t < count; ++t) {
        const View<const f64> mass = filtered.mass[t + 1];
        for (i64 k = 0; k < model.nodes(); ++k) places(t, k / model.stages()) += mass[k];
    }
    for (i64 stage = 0; stage < model.stages(); ++stage) {
        const View<const f64> in_view = filtered.in_view[count][stage], hidden = filtered.hidden[count][stage];
        std::copy(in_view.begin(), in_view.end(), now[0][stage].begin());
        std::copy(hidden.begin(), hidden.end(), now[1][stage].begin());
    }
    const View<const u8> last = stretches.shown(count - 1);
    std::copy(last.begin(), last.end(), shown.begin());
    return places;
}

namespace {

// The patches in which a user was perceived in a bin.
struct Sighting {
    i64 begin = 0;  // the first of them among the sightings
    i64 end = 0;
    i64 patch = -1;  // the last of them; -1: none

    i64 patches() const { return end - begin; }
};

// Whether two bins can be merged: with the same sighting.
bool alike(Sighting sighting, Sighting before) {
    return sighting.patches() < 2 && before.patches() < 2 && sighting.patch == before.patch;
}

}  // namespace

OwnedStretches merge_bins(View<const i64> minute, View<const i64> view, const PatchCounts& seen, i64 longest) {
    struct Opening {
        i64 bin;  // the first of a stretch
        Sighting sighting;
    };
    std::vector<Opening> openings;
    Sighting before;
    i64 sightings = 0;
    const i64 bins = view.size();
    for (i64 t = 0; t < bins; ++t) {
        Sighting now{before.end, before.end, -1};
        for (; now.end < seen.bin.size() && seen.bin[now.end] == t; ++now.end) now.patch = seen.patch[now.end];
        const bool goes_on = t > 0 && t - openings.back().bin < longest &&
                             floor_div(minute[openings.back().bin], 60) == floor_div(minute[t], 60) &&
                             view[t] == view[t - 1] && alike(now, before);
        if (!goes_on) {
            openings.push_back({t, now});
            sightings += now.patches();
        }
        before = now;
    }

    const i64 count = static_cast<i64>(openings.size());
    OwnedStretches result;
    result.bins = Array<i64>::empty({count});
    result.view = Array<i64>::empty({count});
    result.begin = Array<i64>::zeros({count + 1});
    result.patch = Array<i64>::empty({sightings});
    result.share = Array<f64>::empty({sightings});
    i64 used = 0, end = bins;
    for (i64 i = count - 1; i >= 0; --i) {
        const i64 bin = openings[static_cast<std::size_t>(i)].bin;
        result.bins[i] = end - bin;
        end = bin;
    }
    for (i64 i = 0; i < count; ++i) {
        const auto [bin, sighting] = openings[static_cast<std::size_t>(i)];
        result.view[i] = view[bin];
        f64 total = 0.0;
        for (i64 k = sighting.begin; k < sighting.end; ++k) total += static_cast<f64>(seen.steps[k]);
        for (i64 k = sighting.begin; k < sighting.end; ++k) {
            result.patch[used] = seen.patch[k];
            result.share[used] = static_cast<f64>(seen.steps[k]) / total;
            ++used;
        }
        result.begin[i + 1] = used;
    }
    return result;
}

}  // namespace fleet2d
