#include "smoothing.hpp"

#include "people.hpp"

namespace fleet2d {
namespace {

// The sum of products, in order.
template <int W>
Lanes<W> dot(View<const Lanes<W>> a, View<const Lanes<W>> b, Range range) {
    Lanes<W> sum = 0.0;
    for (i64 p = range.begin; p < range.end; ++p) sum += a[p] * b[p];
    return sum;
}

template <int W>
void multiply(const Lanes<W>& factor, View<const Lanes<W>> from, View<Lanes<W>> to, Range range) {
    for (i64 p = range.begin; p < range.end; ++p) to[p] = factor * from[p];
}

// Moments of a group, as in Moments.
template <int W>
struct GroupMoments {
    Array<Lanes<W>> time;      // (nodes,)
    Array<Lanes<W>, 2> exits;  // (nodes, rooms + 1)
    Array<Lanes<W>> arrivals;  // (patches,)
    Array<Lanes<W>> moves;     // (rooms,)
    Array<Lanes<W>> rests;     // (rooms,)

    explicit GroupMoments(const StayModel& layout)
        : time(Array<Lanes<W>>::zeros({layout.nodes()})),
          exits(Array<Lanes<W>, 2>::zeros({layout.nodes(), layout.rooms() + 1})),
          arrivals(Array<Lanes<W>>::zeros({layout.patches()})),
          moves(Array<Lanes<W>>::zeros({layout.rooms()})),
          rests(Array<Lanes<W>>::zeros({layout.rooms()})) {}

    void add_to(const Moments& moments, i64 lane) const {
        add(time, moments.time, lane);
        for (i64 k = 0; k < exits.size(); ++k) add(exits[k], moments.exits[k], lane);
        add(arrivals, moments.arrivals, lane);
        add(moves, moments.moves, lane);
        add(rests, moments.rests, lane);
    }

private:
    static void add(View<const Lanes<W>> from, View<f64> to, i64 lane) {
        for (i64 i = 0; i < from.size(); ++i) to[i] += from[i][lane];
    }
};

// Goes through filtered stretches from the last to the first.
template <int W>
class BackwardPass {
public:
    BackwardPass(const Group<W>& group, Steps<W>& steps, const Filtered<W>& filtered)
        : model_(group.layout()),
          steps_(steps),
          filtered_(filtered),
          rooms_(model_.rooms()),
          stages_(model_.stages()),
          moments_(model_),
          ahead_in_view_(states()),
          ahead_hidden_(states()),
          in_view_(states()),
          hidden_(states()),
          comes_(states()),
          sums_(Array<Lanes<W>>::empty({model_.nodes()})),
          places_(Array<Lanes<W>>::empty({rooms_})),
          arrival_(Array<Lanes<W>>::empty({rooms_})),
          go_(Array<Lanes<W>>::empty({model_.nodes()})),
          comers_(Array<Lanes<W>>::empty({rooms_})) {}

    // Begin after the last stretch; `end` (stages, patches) is the filtered probability, `future` as for `smooth`.
    void begin(View<const f64, 2> end, View<const f64, 2> future, i64 lane) {
        f64 total = 0.0;
        for (i64 stage = 0; stage < stages_; ++stage) {
            for (i64 p = 0; p < model_.patches(); ++p) total += end(stage, p) * future(stage, p);
        }
        for (i64 stage = 0; stage < stages_; ++stage) {
            for (i64 p = 0; p < model_.patches(); ++p) {
                ahead_in_view_(stage, p)[lane] = ahead_hidden_(stage, p)[lane] = future(stage, p) / total;
            }
        }
    }

    // Go back over a stretch of each person; `places` (stretches, rooms) of each become P(room) in it.
    void step(i64 t, const std::array<View<f64, 2>, W>& places) {
        steps_.go_to(t);
        locate_people(t);
        for (std::size_t lane = 0; lane < W; ++lane) {
            if (steps_.is_idle(lane)) continue;
            for (i64 room = 0; room < rooms_; ++room) places[lane](t, room) = places_[room][lane];
        }
        weigh_states(t);
        leave(t);
        for (i64 stage = 0; stage < stages_; ++stage) {
            arrive(t, stage);
            stay(t, stage, stage);
            if (stage + 1 < stages_) stay(t, stage, stage + 1);
        }
    }

    // Set the likelihood of all later evidence for each hidden state, largest 1: (stages, patches).
    void set_ahead(View<f64, 2> ahead, i64 lane) const {
        f64 largest = ahead_hidden_[0][0][lane];
        for (i64 stage = 0; stage < stages_; ++stage) {
            for (const Lanes<W>& value : ahead_hidden_[stage]) largest = std::max(largest, value[lane]);
        }
        for (i64 stage = 0; stage < stages_; ++stage) {
            for (i64 p = 0; p < model_.patches(); ++p) ahead(stage, p) = ahead_hidden_[stage][p][lane] / largest;
        }
    }

    const GroupMoments<W>& moments() const { return moments_; }

private:
    Array<Lanes<W>, 2> states() const { return Array<Lanes<W>, 2>::zeros({stages_, model_.patches()}); }

    // P(room) in a stretch.
    void locate_people(i64 t) {
        const View<const bool> visible = filtered_.visible[t + 1];
        for (i64 stage = 0; stage < stages_; ++stage) {
            const View<const Lanes<W>> in_view = filtered_.in_view[t + 1][stage];
            const View<const Lanes<W>> hidden = filtered_.hidden[t + 1][stage];
            const View<const Lanes<W>> if_in_view = ahead_in_view_[stage], if_hidden = ahead_hidden_[stage];
            for (i64 room = 0; room < rooms_; ++room) {
                const Range range = model_.patches_of(room);
                Lanes<W> sum = 0.0;
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
        Lanes<W> total = 0.0;
        std::fill_n(places_.data(), rooms_, Lanes<W>(0.0));
        for (i64 k = 0; k < model_.nodes(); ++k) {
            places_[k / stages_] += sums_[k];
            total += sums_[k];
        }
        for (i64 room = 0; room < rooms_; ++room) places_[room] = places_[room] / total;
    }

    // Whether a room is in view before or after a stretch: else its states in view play no part in it.
    bool is_watched(i64 t, i64 room) const { return filtered_.visible[t][room] || filtered_.visible[t + 1][room]; }

    // The likelihood of a stretch and of all later ones for each state, and for coming to each patch; scaled so that
    // products with the filtered probability sum to one. Where nothing is in view only the latter is set: it is the
    // same as that of hidden states.
    void weigh_states(i64 t) {
        const View<const Lanes<W>> likely = filtered_.likely[t];
        const Lanes<W> scale = filtered_.scale[t];
        const Lanes<W> if_in_view = likely[0] * scale, if_hidden = likely[1] * scale;
        for (i64 stage = 0; stage < stages_; ++stage) {
            multiply<W>(if_hidden, ahead_hidden_[stage], comes_[stage], {0, model_.patches()});
            for (i64 room = 0; room < rooms_; ++room) {
                if (!is_watched(t, room)) continue;
                const Range range = model_.patches_of(room);
                multiply<W>(if_hidden, ahead_hidden_[stage], hidden_[stage], range);
                multiply<W>(if_in_view, ahead_in_view_[stage], in_view_[stage], range);
            }
        }
        steps_.sightings(t, likely, [&](i64 lane, i64 p, bool in_view, f64 factor) {
            for (i64 stage = 0; stage < stages_; ++stage) {
                (in_view ? in_view_ : hidden_)(stage, p)[lane] *= factor;
                if (!in_view) comes_(stage, p)[lane] *= factor;
            }
        });
        const View<const bool> visible = filtered_.visible[t + 1];
        for (i64 room = 0; room < rooms_; ++room) {
            if (!visible[room]) continue;
            const auto [begin, end] = model_.patches_of(room);
            for (i64 stage = 0; stage < stages_; ++stage) {
                draw_view(end - begin, steps_.part().data + begin, in_view_[stage].data + begin,
                          hidden_[stage].data + begin, comes_[stage].data + begin);
            }
        }
    }

    // The likelihood for coming to each patch of a room that is in view in parts.
    static void draw_view(i64 patches, const Lanes<W>* part, const Lanes<W>* in_view, const Lanes<W>* hidden,
                          Lanes<W>* __restrict comes) {
        for (i64 p = 0; p < patches; ++p) {
            comes[p] = part[p] * in_view[p] + (Lanes<W>(1.0) - part[p]) * hidden[p];
        }
    }

    // Add the expected moments of leaving rooms and of changes of patch. Sets `go_` and `comers_`.
    void leave(i64 t) {
        const View<const Lanes<W>> mass = filtered_.mass[t], hop = steps_.hop, over = steps_.over;
        const View<const Lanes<W>, 2> follow = steps_.follow();
        const Lanes<W> halfway = until_event();
        for (i64 room = 0; room < rooms_; ++room) {
            arrival_[room] = dot<W>(steps_.spread(), comes_[0], model_.patches_of(room));
            comers_[room] = 0.0;
        }
        for (i64 room = 0; room < rooms_; ++room) {
            for (i64 stage = 0; stage < stages_; ++stage) {
                const i64 k = node(room, stage);
                const Lanes<W> left = leave_node(rooms_, mass[k], over[k], follow[k].data, arrival_.data(),
                                                 comers_.data(), moments_.exits[k].data);
                const Lanes<W> drawn =
                    stage == 0 ? arrival_[room] : dot<W>(steps_.spread(), comes_[stage], model_.patches_of(room));
                const Lanes<W> moved = hop[k] * drawn;
                go_[k] = left + moved;
                moments_.time[k] += mass[k] * (halfway * left + steps_.bins * moved);
                moments_.moves[room] += mass[k] * moved;
                moments_.rests[room] += mass[k] * (halfway - Lanes<W>(1.0)) * moved;
            }
        }
    }

    // Add the expected exits of one node; returns the likelihood of the later evidence given an exit.
    static Lanes<W> leave_node(i64 rooms, const Lanes<W>& mass, const Lanes<W>& over, const Lanes<W>* follow,
                               const Lanes<W>* arrival, Lanes<W>* __restrict comers, Lanes<W>* __restrict exits) {
        Lanes<W> left = 0.0;
        for (i64 room = 0; room < rooms; ++room) {
            const Lanes<W> chance = over * follow[room];
            left += chance * arrival[room];
            comers[room] += mass * chance;
            exits[room] += mass * chance * arrival[room];
        }
        return left;
    }

    // Add the expected arrivals at patches in a stretch.
    void arrive(i64 t, i64 stage) {
        const View<const Lanes<W>> mass = filtered_.mass[t], hop = steps_.hop;
        for (i64 room = 0; room < rooms_; ++room) {
            const i64 k = node(room, stage);
            const auto [begin, end] = model_.patches_of(room);
            Lanes<W> came = hop[k] * mass[k];
            if (stage == 0) came += comers_[room];
            arrive_room(end - begin, came, steps_.spread().data + begin, comes_[stage].data + begin,
                        moments_.arrivals.data() + begin);
        }
    }

    static void arrive_room(i64 patches, const Lanes<W>& came, const Lanes<W>* spread, const Lanes<W>* comes,
                            Lanes<W>* __restrict arrivals) {
        for (i64 p = 0; p < patches; ++p) arrivals[p] += came * spread[p] * comes[p];
    }

    // Update the likelihoods of a stage for persons who stay in their patch, in stage `then`, which is the same stage
    // or the next one; and add the expected moments.
    void stay(i64 t, i64 stage, i64 then) {
        const View<const Lanes<W>> was = filtered_.hidden[t][stage], comes = comes_[then];
        const View<Lanes<W>> to = ahead_hidden_[stage];
        const View<const bool> visible = filtered_.visible[t];
        for (i64 room = 0; room < rooms_; ++room) {
            const i64 k = node(room, stage);
            const auto [begin, end] = model_.patches_of(room);
            const Lanes<W> chance =
                then == stage ? steps_.rest[k] : steps_.over[k] * steps_.follow()(k, model_.next_stage());
            Lanes<W> total;
            if (visible[room]) {
                total = stay_visible(t, stage, then, room, chance);
            } else {
                total = stay_hidden(end - begin, chance, then == stage, go_[k], comes.data + begin, was.data + begin,
                                    to.data + begin);
            }
            if (then == stage) {
                moments_.time[k] += steps_.bins * total;
                moments_.rests[room] += steps_.bins * total;
            } else {
                moments_.time[k] += until_event() * total;
                moments_.exits(k, model_.next_stage()) += total;
            }
        }
    }

    // The same for a room that was visible; returns the probability of staying.
    Lanes<W> stay_visible(i64 t, i64 stage, i64 then, i64 room, const Lanes<W>& chance) {
        const View<const Lanes<W>> was_in_view = filtered_.in_view[t][stage], was_hidden = filtered_.hidden[t][stage];
        const View<Lanes<W>> to_in_view = ahead_in_view_[stage], to_hidden = ahead_hidden_[stage];
        const View<const Lanes<W>> in_view = in_view_[then], hidden = hidden_[then], comes = comes_[then];
        const View<const Lanes<W>> same = steps_.same();
        const Lanes<W> go = go_[node(room, stage)];
        const auto [begin, end] = model_.patches_of(room);
        Lanes<W> total = 0.0;
        for (i64 p = begin; p < end; ++p) {
            const Lanes<W> drawn = (Lanes<W>(1.0) - same[p]) * comes[p];
            const Lanes<W> if_in_view = chance * (same[p] * in_view[p] + drawn);
            const Lanes<W> if_hidden = chance * (same[p] * hidden[p] + drawn);
            to_in_view[p] = (then == stage ? go : to_in_view[p]) + if_in_view;
            to_hidden[p] = (then == stage ? go : to_hidden[p]) + if_hidden;
            total += was_in_view[p] * if_in_view + was_hidden[p] * if_hidden;
        }
        return total;
    }

    // The same for a room that wasn't visible, where a hidden person's view is drawn anew.
    static Lanes<W> stay_hidden(i64 patches, const Lanes<W>& chance, bool first, const Lanes<W>& go,
                                const Lanes<W>* comes, const Lanes<W>* was, Lanes<W>* __restrict to) {
        Lanes<W> total = 0.0;
        for (i64 p = 0; p < patches; ++p) {
            const Lanes<W> likely = chance * comes[p];
            to[p] = (first ? go : to[p]) + likely;
            total += was[p] * likely;
        }
        return total;
    }

    // Mean number of bins until an event within a stretch.
    Lanes<W> until_event() const { return Lanes<W>(0.5) * (steps_.bins + Lanes<W>(1.0)); }

    i64 node(i64 room, i64 stage) const { return room * stages_ + stage; }

    const StayModel& model_;  // the layout
    Steps<W>& steps_;
    const Filtered<W>& filtered_;
    const i64 rooms_, stages_;
    GroupMoments<W> moments_;
    // The likelihood of all evidence after a stretch for each state, (stages, patches). In view only where visible.
    Array<Lanes<W>, 2> ahead_in_view_, ahead_hidden_;
    // The likelihood of a stretch and all later ones for each state, and for coming to each patch, (stages, patches).
    Array<Lanes<W>, 2> in_view_, hidden_, comes_;
    Array<Lanes<W>> sums_;     // (nodes,)
    Array<Lanes<W>> places_;   // (rooms,) P(room)
    Array<Lanes<W>> arrival_;  // (rooms,) likelihood of a stretch and all later ones given an arrival in the room
    Array<Lanes<W>> go_;       // (nodes,) likelihood of the later evidence given an exit or a change of patch
    Array<Lanes<W>> comers_;   // (rooms,) probability of coming from another room
};

// What is known of one person of a group, and what becomes of it; as in Smoothed.
struct Ends {
    View<const f64, 2> future;
    View<f64, 2> end, ahead;
    Moments moments;
};

// Smooth a group; `places` (stretches, rooms) of each become P(room).
template <int W>
void smooth_group(const Group<W>& group, Filtered<W>& filtered, const std::array<View<f64, 2>, W>& places,
                  const std::array<Ends, W>& ends) {
    const i64 count = group.steps();
    Steps<W> steps(group);
    ForwardPass<W> forward(group, steps, filtered);
    forward.run();
    BackwardPass<W> backward(group, steps, filtered);
    for (std::size_t lane = 0; lane < W; ++lane) {
        const View<f64, 2> end = ends[lane].end;
        for (i64 stage = 0; stage < end.size(); ++stage) {
            for (i64 p = 0; p < end.shape[1]; ++p) {
                end(stage, p) = filtered.in_view(count, stage, p)[lane] + filtered.hidden(count, stage, p)[lane];
            }
        }
        backward.begin(end, ends[lane].future, lane);
    }
    for (i64 t = count - 1; t >= 0; --t) backward.step(t, places);
    for (std::size_t lane = 0; lane < W; ++lane) {
        backward.set_ahead(ends[lane].ahead, lane);
        if (static_cast<i64>(lane) < group.people) backward.moments().add_to(ends[lane].moments, lane);
    }
}

}  // namespace

Smoothed smooth(const StayModel& model, const Stretches& stretches, View<const f64, 2> prior, View<const f64, 2> future,
                const Moments& moments) {
    const i64 count = stretches.size(), stages = model.stages(), patches = model.patches();
    const Array<f64, 3> now = all_hidden(prior);
    const Array<i64> shown = Array<i64>::filled({patches}, -1);
    const Array<bool, 2> in_view = rooms_in_view(model, stretches.views);
    Smoothed result{Array<f64, 2>::zeros({count, model.rooms()}), Array<f64, 2>::empty({stages, patches}),
                    Array<f64, 2>::empty({stages, patches})};
    Filtered<1> filtered;
    smooth_group<1>({1, {model}, {stretches}, in_view, {now}, {shown}}, filtered, {result.places.view()},
                    {Ends{future, result.end, result.ahead, moments}});
    return result;
}

PeopleSmoothed smooth_people(const PeopleModel& model, const DayEvidence& day, i64 longest, View<const f64, 3> prior,
                             View<const f64, 3> future, const PeopleMoments& moments) {
    const std::vector<OwnedStretches> stretches = day.stretches(model.size(), longest);
    PeopleSmoothed result{PeoplePlaces::of(stretches, model.restless.shape[1]), Array<f64, 3>::empty(prior.shape),
                          Array<f64, 3>::empty(prior.shape)};
    if (model.size() == 0) return result;
    const SharedViews shared(model.of(0), day.views);
    in_groups(model.size(), [&]<int W>(Filtered<W>& filtered, i64 first) {
        const auto of = [&](i64 lane) { return person_of(lane, first, model.size()); };
        const auto now = for_lanes<W>([&](i64 lane) { return all_hidden(prior[of(lane)]); });
        const Group<W> group = group_of<W>(model, stretches, shared, first, now);
        const auto places = for_lanes<W>([&](i64 lane) { return result.where.of(of(lane)); });
        const auto ends = for_lanes<W>([&](i64 lane) {
            const i64 person = of(lane);
            return Ends{future[person], result.end[person], result.ahead[person], moments.of(person)};
        });
        side_by_side<W>([&] { smooth_group<W>(group, filtered, places, ends); });
    });
    return result;
}

}  // namespace fleet2d
