// The chains of a group of people, gone through side by side: what they share, and the way forward.
//
// All have the same rooms, stages, patches and views. A person who has fewer stretches than another has stretches of
// no bins at the end: they change nothing, to the last bit.
#pragma once

#include <vector>

#include "lanes.hpp"
#include "stays.hpp"

namespace fleet2d {

// People, their evidence, and what is known before it.
template <int W>
struct Group {
    i64 people;  // those of the lanes after them aren't recorded
    std::array<StayModel, W> models;
    std::array<Stretches, W> stretches;
    View<const bool, 2> in_view;            // (views, rooms) whether something of the room is in view
    std::array<View<const f64, 3>, W> now;  // (2, stages, patches) probability of states in view, and of hidden ones
    std::array<View<const i64>, W> shown;   // (patches,) part of each patch that was in view, -1 if unknown

    const StayModel& layout() const { return models[0]; }  // its transitions are those of the first person
    i64 steps() const {
        i64 most = 0;
        for (const Stretches& own : stretches) most = std::max(most, own.size());
        return most;
    }
};

// Which rooms something is in view of: (views, rooms).
Array<bool, 2> rooms_in_view(const StayModel& model, View<const u8, 2> views);

// A base to a whole power, by multiplications.
f64 whole_power(f64 base, i64 exponent);

// The transitions of a group of people, and those over the stretches that begin at one step.
template <int W>
class Steps {
public:
    explicit Steps(const Group<W>& group)
        : group_(group), nodes_(group.layout().nodes()), patches_(group.layout().patches()) {
        lengths_.push_back(0);
        for (const Stretches& own : group.stretches) lengths_.insert(lengths_.end(), own.bins.begin(), own.bins.end());
        std::sort(lengths_.begin(), lengths_.end());
        lengths_.erase(std::unique(lengths_.begin(), lengths_.end()), lengths_.end());
        const i64 count = static_cast<i64>(lengths_.size()), columns = group.layout().follow.shape[1];
        over_ = Array<Lanes<W>, 2>::empty({count + 1, nodes_});
        rest_ = Array<Lanes<W>, 2>::empty({count + 1, nodes_});
        hop_ = Array<Lanes<W>, 2>::empty({count + 1, nodes_});
        missed_ = Array<Lanes<W>>::empty({count});
        follow_ = Array<Lanes<W>, 2>::empty({nodes_, columns});
        spread_ = Array<Lanes<W>>::empty({patches_});
        part_ = Array<Lanes<W>>::empty({patches_});
        same_ = Array<Lanes<W>>::filled({patches_}, 1.0);
        row_of_view_.fill(-1);
        for (int lane = 0; lane < W; ++lane) pack(lane);
    }

    // Go to a step.
    void go_to(i64 t) {
        bool alike = true;
        for (int lane = 0; lane < W; ++lane) {
            const Stretches& own = group_.stretches[lane];
            idle_[lane] = t >= own.size();
            const i64 length = idle_[lane] ? 0 : own.bins[t];
            bins[lane] = static_cast<f64>(length);
            row_[lane] = std::lower_bound(lengths_.begin(), lengths_.end(), length) - lengths_.begin();
            missed[lane] = missed_[row_[lane]][lane];
            alike &= row_[lane] == row_[0];
            compare_views(t, lane);
        }
        i64 row = row_[0];
        if (!alike) {
            row = over_.size() - 1;
            for (i64 k = 0; k < nodes_; ++k) {
                for (int lane = 0; lane < W; ++lane) {
                    over_(row, k)[lane] = over_(row_[lane], k)[lane];
                    rest_(row, k)[lane] = rest_(row_[lane], k)[lane];
                    hop_(row, k)[lane] = hop_(row_[lane], k)[lane];
                }
            }
        }
        over = over_[row], rest = rest_[row], hop = hop_[row];
    }

    bool is_idle(int lane) const { return idle_[lane]; }
    View<const u8> shown(int lane) const { return shown_[lane]; }
    // (patches,) the part of each patch in view, from 0 to 1.
    View<const Lanes<W>> part() const { return part_; }
    // (patches,) 1 where that is the same as before, else 0. A product with it takes or leaves a probability exactly.
    View<const Lanes<W>> same() const { return same_; }
    View<const Lanes<W>, 2> follow() const { return follow_; }
    View<const Lanes<W>> spread() const { return spread_; }

    // Call `weigh(lane, patch, in_view, factor)` for all sightings in stretch t. They are evidence for states in view,
    // or for hidden states of a patch of which nothing is in view, as positions may be noisy. `likely` is that of no
    // sighting, for states in view and for hidden ones.
    template <class Weigh>
    void sightings(i64 t, View<const Lanes<W>> likely, Weigh weigh) const {
        for (int lane = 0; lane < W; ++lane) {
            if (idle_[lane]) continue;
            const Stretches& own = group_.stretches[lane];
            for (i64 i = own.begin[t]; i < own.begin[t + 1]; ++i) {
                const bool in_view = shown_[lane][own.patch[i]] > 0;
                weigh(lane, own.patch[i], in_view, 1.0 + own.share[i] / likely[in_view ? 0 : 1][lane]);
            }
        }
    }

    Lanes<W> bins;    // of the stretches
    Lanes<W> missed;  // probability that a person in view isn't perceived
    View<const Lanes<W>> over, rest,
        hop;  // (nodes,) that the stage ends; that it goes on, without and with another patch

private:
    void pack(int lane) {
        const StayModel& model = group_.models[lane];
        for (i64 i = 0; i < missed_.size(); ++i) {
            const i64 length = lengths_[static_cast<std::size_t>(i)];
            for (i64 k = 0; k < nodes_; ++k) {
                const f64 kept = whole_power(model.stay[k], length);
                const f64 moved = 1.0 - whole_power(1.0 - model.restless[k / model.stages()], length);
                over_(i, k)[lane] = 1.0 - kept;
                rest_(i, k)[lane] = kept * (1.0 - moved);
                hop_(i, k)[lane] = kept * moved;
            }
            missed_[i][lane] = std::max(whole_power(1.0 - model.detection, length), NEVER_SURE);
        }
        for (i64 k = 0; k < nodes_; ++k) {
            for (i64 j = 0; j < follow_.shape()[1]; ++j) follow_(k, j)[lane] = model.follow(k, j);
        }
        for (i64 p = 0; p < patches_; ++p) spread_[p][lane] = model.spread[p];
    }

    void compare_views(i64 t, int lane) {
        const Stretches& own = group_.stretches[lane];
        const i64 last = std::min(t, own.size() - 1);
        const View<const u8> now = shown_[lane] = own.shown(last);
        if (row_of_view_[lane] != own.view[last]) {
            row_of_view_[lane] = own.view[last];
            for (i64 p = 0; p < patches_; ++p) part_[p][lane] = part_in_view(now[p]);
        }
        const bool had_other_view = has_other_view_[lane];
        has_other_view_[lane] = t == 0 || (t == last && own.view[t] != own.view[t - 1]);
        if (t == 0) {
            for (i64 p = 0; p < patches_; ++p) same_[p][lane] = now[p] == group_.shown[lane][p];
        } else if (has_other_view_[lane]) {
            const View<const u8> before = own.shown(t - 1);
            for (i64 p = 0; p < patches_; ++p) same_[p][lane] = now[p] == before[p];
        } else if (had_other_view) {
            for (i64 p = 0; p < patches_; ++p) same_[p][lane] = 1.0;
        }
    }

    const Group<W>& group_;
    const i64 nodes_, patches_;
    std::vector<i64> lengths_;              // ascending, from 0
    Array<Lanes<W>, 2> over_, rest_, hop_;  // (lengths + 1, nodes); the last row is of stretches of several lengths
    Array<Lanes<W>> missed_;                // (lengths,)
    Array<Lanes<W>, 2> follow_;             // (nodes, rooms + 1)
    Array<Lanes<W>> spread_;                // (patches,)
    Array<Lanes<W>> part_, same_;           // (patches,)
    std::array<View<const u8>, W> shown_;
    std::array<i64, W> row_of_view_{}, row_{};  // of the views, and of the tables
    std::array<bool, W> idle_{}, has_other_view_{};
};

// The filtered distributions: given the evidence up to each stretch; index 0 is before the first stretch.
//
// Robots see few rooms at a time. Where `visible` is false, nothing of the room is in view of anybody in the group:
// that half of the states can be skipped, without changing any sum, and is set to 0 only where it is needed.
template <int W>
struct Filtered {
    Array<Lanes<W>, 3> in_view;  // (steps + 1, stages, patches) probability of each state in view
    Array<Lanes<W>, 3> hidden;   // (steps + 1, stages, patches) probability of each hidden state
    Array<bool, 2> visible;      // (steps + 1, rooms) whether a person may be in view in the room
    Array<Lanes<W>, 2> mass;     // (steps + 1, nodes) probability of each node
    Array<Lanes<W>, 2> likely;   // (steps, 2) likelihood of no sighting, for states in view and for hidden ones
    Array<Lanes<W>> scale;       // (steps,) factor that normalized the probabilities

    // Make room for so many steps; the memory of another group is used again.
    void fit(const StayModel& layout, i64 steps) {
        const i64 stages = layout.stages(), patches = layout.patches(), rooms = layout.rooms();
        if (scale.size() >= steps && hidden.shape()[1] == stages && hidden.shape()[2] == patches) return;
        const i64 count = steps + steps / 8;
        in_view = Array<Lanes<W>, 3>::empty({count + 1, stages, patches});
        hidden = Array<Lanes<W>, 3>::empty({count + 1, stages, patches});
        visible = Array<bool, 2>::empty({count + 1, rooms});
        mass = Array<Lanes<W>, 2>::empty({count + 1, layout.nodes()});
        likely = Array<Lanes<W>, 2>::empty({count, 2});
        scale = Array<Lanes<W>>::empty({count});
    }
};

// Goes through stretches from the first to the last.
template <int W>
class ForwardPass {
public:
    ForwardPass(const Group<W>& group, Steps<W>& steps, Filtered<W>& filtered)
        : group_(group),
          model_(group.layout()),
          steps_(steps),
          filtered_(filtered),
          rooms_(model_.rooms()),
          stages_(model_.stages()),
          comers_(Array<Lanes<W>>::empty({rooms_})) {
        filtered.fit(model_, group.steps());
        begin();
    }

    // Advance over all stretches.
    void run() {
        const i64 count = group_.steps();
        for (i64 t = 0; t < count; ++t) step(t);
        for (i64 room = 0; room < rooms_; ++room) {
            if (!filtered_.visible(count, room)) hide(count, room);
        }
    }

private:
    // Advance over one stretch of each person.
    void step(i64 t) {
        steps_.go_to(t);
        for (int lane = 0; lane < W; ++lane) {
            const View<const i64> first = group_.stretches[lane].begin;
            const f64 weight = !steps_.is_idle(lane) && first[t + 1] > first[t] ? FALSE_ALARM : 1.0;
            filtered_.likely(t, 0)[lane] = weight * steps_.missed[lane];
            filtered_.likely(t, 1)[lane] = weight;
        }
        count_comers(t);
        for (i64 room = 0; room < rooms_; ++room) {
            const bool visible = filtered_.visible(t + 1, room) = becomes_visible(t, room);
            if (visible && !filtered_.visible(t, room)) hide(t, room);
        }
        for (i64 stage = 0; stage < stages_; ++stage) predict(t, stage);
        steps_.sightings(t, filtered_.likely[t], [&](int lane, i64 p, bool in_view, f64 factor) {
            const View<Lanes<W>, 2> states = in_view ? filtered_.in_view[t + 1] : filtered_.hidden[t + 1];
            for (i64 stage = 0; stage < stages_; ++stage) states(stage, p)[lane] *= factor;
        });
        sum_nodes(t + 1);
        normalize(t);
    }

    // Set the states in view of a room to 0.
    void hide(i64 t, i64 room) {
        const auto [begin, end] = model_.patches_of(room);
        for (i64 stage = 0; stage < stages_; ++stage) {
            for (Lanes<W>& part : filtered_.in_view[t][stage].slice(begin, end)) part = 0.0;
        }
    }

    // Set the distribution before the first stretch.
    void begin() {
        std::ranges::fill(filtered_.visible[0], false);
        for (i64 stage = 0; stage < stages_; ++stage) {
            const View<Lanes<W>> in_view = filtered_.in_view[0][stage], hidden = filtered_.hidden[0][stage];
            for (int lane = 0; lane < W; ++lane) {
                const View<const f64, 3> now = group_.now[lane];
                for (i64 p = 0; p < model_.patches(); ++p) {
                    in_view[p][lane] = now(0, stage, p);
                    hidden[p][lane] = now(1, stage, p);
                }
            }
            for (i64 room = 0; room < rooms_; ++room) {
                const auto [begin, end] = model_.patches_of(room);
                Lanes<W> sum = 0.0;
                for (i64 p = begin; p < end; ++p) {
                    sum += in_view[p] + hidden[p];
                    for (int lane = 0; lane < W; ++lane) filtered_.visible(0, room) |= in_view[p][lane] != 0.0;
                }
                filtered_.mass(0, node(room, stage)) = sum;
            }
        }
    }

    // The probability of coming to each room from a stage that ends.
    void count_comers(i64 t) {
        const View<const Lanes<W>> mass = filtered_.mass[t], over = steps_.over;
        const View<const Lanes<W>, 2> follow = steps_.follow();
        std::fill_n(comers_.data(), rooms_, Lanes<W>(0.0));
        for (i64 k = 0; k < model_.nodes(); ++k) {
            const Lanes<W> leaving = mass[k] * over[k];
            add_product(rooms_, leaving, follow[k].data, comers_.data());
        }
    }

    static void add_product(i64 count, Lanes<W> factor, const Lanes<W>* from, Lanes<W>* __restrict to) {
        for (i64 i = 0; i < count; ++i) to[i] += factor * from[i];
    }

    // Whether a person may be in view in a room after a stretch.
    bool becomes_visible(i64 t, i64 room) const {
        for (int lane = 0; lane < W; ++lane) {
            const View<const i64> view = group_.stretches[lane].view;
            if (group_.in_view(view[std::min(t, view.size() - 1)], room)) return true;
        }
        if (!filtered_.visible[t][room]) return false;
        // Without a view `in_view` becomes 0; but the initial distribution may have states in view.
        const auto [begin, end] = model_.patches_of(room);
        for (i64 stage = 0; stage < stages_; ++stage) {
            const View<const Lanes<W>> in_view = filtered_.in_view[t][stage], same = steps_.same();
            for (i64 p = begin; p < end; ++p) {
                const Lanes<W> kept = same[p] * in_view[p];
                for (int lane = 0; lane < W; ++lane) {
                    if (kept[lane] != 0.0) return true;
                }
            }
        }
        return false;
    }

    // The sources of the probability of one stage of stays in a room.
    struct Flow {
        Lanes<W> came;    // probability of coming to the room, or of changing patch in it
        Lanes<W> rest;    // probability of staying in the stage and in the patch
        Lanes<W> onward;  // probability of coming from the previous stage; 0 if there is none
    };

    // The probability of the states of a stage after a stretch without sightings.
    void predict(i64 t, i64 stage) {
        const View<const Lanes<W>> mass = filtered_.mass[t], over = steps_.over, rest = steps_.rest, hop = steps_.hop;
        const View<const bool> before = filtered_.visible[t], after = filtered_.visible[t + 1];
        const Lanes<W>* was = filtered_.hidden[t][stage].data;
        const Lanes<W>* last = stage == 0 ? nullptr : filtered_.hidden[t][stage - 1].data;
        Lanes<W>* now = filtered_.hidden[t + 1][stage].data;
        const Lanes<W> likely = filtered_.likely(t, 1);
        for (i64 room = 0; room < rooms_; ++room) {
            const auto [begin, end] = model_.patches_of(room);
            const i64 k = node(room, stage);
            Flow flow{hop[k] * mass[k], rest[k], 0.0};
            if (stage == 0) {
                flow.came += comers_[room];
            } else {
                flow.onward = over[k - 1] * steps_.follow()(k - 1, model_.next_stage());
            }
            if (before[room] || after[room]) {
                flow_visible(t, stage, room, flow);
            } else {
                flow_hidden(flow, likely, end - begin, steps_.spread().data + begin, was + begin,
                            last == nullptr ? nullptr : last + begin, now + begin);
            }
        }
    }

    // The probability of the hidden states of a room that isn't visible and wasn't, (patches,) arrays: `was` and `now`
    // of the stage before and after a stretch, `last` of the stage before it, nullptr if there is none.
    static void flow_hidden(const Flow& flow, const Lanes<W>& likely, i64 patches, const Lanes<W>* spread,
                            const Lanes<W>* was, const Lanes<W>* last, Lanes<W>* __restrict now) {
        if (last == nullptr) {
            for (i64 p = 0; p < patches; ++p) now[p] = (flow.came * spread[p] + flow.rest * was[p]) * likely;
        } else {
            for (i64 p = 0; p < patches; ++p) {
                now[p] = (flow.came * spread[p] + (flow.rest * was[p] + flow.onward * last[p])) * likely;
            }
        }
    }

    // The same for a room that is visible, or was.
    void flow_visible(i64 t, i64 stage, i64 room, const Flow& flow) {
        const i64 earlier = std::max(stage - 1, i64{0});  // flow.onward is 0 at the first stage
        const View<const Lanes<W>, 2> in_view = filtered_.in_view[t], hidden = filtered_.hidden[t];
        const View<const Lanes<W>> was_in_view = in_view[stage], was_hidden = hidden[stage], spread = steps_.spread();
        const View<const Lanes<W>> last_in_view = in_view[earlier], last_hidden = hidden[earlier];
        const View<Lanes<W>> now_in_view = filtered_.in_view[t + 1][stage], now_hidden = filtered_.hidden[t + 1][stage];
        const View<const Lanes<W>> part = steps_.part(), same = steps_.same();
        const Lanes<W> if_in_view = filtered_.likely(t, 0), if_hidden = filtered_.likely(t, 1), one = 1.0;
        const auto [begin, end] = model_.patches_of(room);
        for (i64 p = begin; p < end; ++p) {
            const Lanes<W> stay_in_view = flow.rest * was_in_view[p] + flow.onward * last_in_view[p];
            const Lanes<W> stay_hidden = flow.rest * was_hidden[p] + flow.onward * last_hidden[p];
            const Lanes<W> drawn = flow.came * spread[p] + (one - same[p]) * (stay_in_view + stay_hidden);
            now_in_view[p] = (part[p] * drawn + same[p] * stay_in_view) * if_in_view;
            now_hidden[p] = ((one - part[p]) * drawn + same[p] * stay_hidden) * if_hidden;
        }
    }

    // Sum the states of each node.
    void sum_nodes(i64 t) {
        const View<const bool> visible = filtered_.visible[t];
        for (i64 stage = 0; stage < stages_; ++stage) {
            const View<const Lanes<W>> in_view = filtered_.in_view[t][stage], hidden = filtered_.hidden[t][stage];
            for (i64 room = 0; room < rooms_; ++room) {
                const auto [begin, end] = model_.patches_of(room);
                Lanes<W> sum = 0.0;
                if (visible[room]) {
                    for (i64 p = begin; p < end; ++p) sum += in_view[p] + hidden[p];
                } else {
                    for (i64 p = begin; p < end; ++p) sum += hidden[p];
                }
                filtered_.mass(t, node(room, stage)) = sum;
            }
        }
    }

    // Normalize the distribution after a stretch.
    void normalize(i64 t) {
        const View<const bool> visible = filtered_.visible[t + 1];
        const View<Lanes<W>> mass = filtered_.mass[t + 1];
        Lanes<W> total = 0.0;
        for (const Lanes<W>& part : mass) total += part;
        Lanes<W> scale = Lanes<W>(1.0) / total;
        for (int lane = 0; lane < W; ++lane) {
            if (steps_.is_idle(lane)) scale[lane] = 1.0;
        }
        filtered_.scale[t] = scale;
        for (Lanes<W>& part : mass) part *= scale;
        for (i64 stage = 0; stage < stages_; ++stage) {
            for (Lanes<W>& part : filtered_.hidden[t + 1][stage]) part *= scale;
            const View<Lanes<W>> in_view = filtered_.in_view[t + 1][stage];
            for (i64 room = 0; room < rooms_; ++room) {
                if (!visible[room]) continue;
                const auto [begin, end] = model_.patches_of(room);
                for (Lanes<W>& part : in_view.slice(begin, end)) part *= scale;
            }
        }
    }

    i64 node(i64 room, i64 stage) const { return room * stages_ + stage; }

    const Group<W>& group_;
    const StayModel& model_;  // the layout
    Steps<W>& steps_;
    Filtered<W>& filtered_;
    const i64 rooms_, stages_;
    Array<Lanes<W>> comers_;  // (rooms,)
};

}  // namespace fleet2d
