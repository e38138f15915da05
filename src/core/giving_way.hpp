// Giving way: other tracks for a body that would come too near to somebody.
//
// Each of them leads the body out of the way, by waiting or by a place beside, and then continues what it was doing,
// later. Only a track that meets nobody on the ways that are known is taken.
#pragma once

#include <functional>
#include <optional>

#include "detours.hpp"
#include "legs.hpp"
#include "meetings.hpp"

namespace fleet2d {

// A body that gives way, and how it goes somewhere.
struct Yielder {
    i64 row;
    f64 turn_rate;  // headings per second
    i64 beat;       // us; late, it leaves a stop at a multiple of that, so that poses recur and their views are known
    // Walks to a point, at home, clear of some discs: adds breakpoints and returns the end; nothing if no way leads
    // there.
    std::function<std::optional<Moment>(Legs&, const Moment&, Point, const std::vector<Disc>&)> go;
    std::function<bool(Point)> can_stand;  // a turn at a corner, on the border of its space, is no stop
};

// What follows a moment of a track is later.
struct Delay {
    i64 after;  // us; what was planned up to that moment has happened, or counts with the delay before
    i64 since;  // us; what was planned before that moment happens at it
    i64 later;  // us; by so much, but
    i64 edge;   // us; a rest that begins then is shortened, so that the body is on time again after it

    i64 of(i64 time) const { return time <= edge ? time + later : std::max(time, edge + later); }
};

// Another track of a body from now on, and how much later it continues the one before: one delay after the other.
struct Detour {
    Legs legs;
    std::vector<Delay> delays;
};

// The breakpoint at which a body next stands still after a moment; -1 for none.
i64 next_stop(const TrackPiece& track, i64 moment, const std::function<bool(Point)>& can_stand);

// The first of some waits after which a body may go on as it planned.
//
// It stands from step `step` on for so many steps, and meets nobody on the known ways, which begin at that step. All
// distances are those of row 0.
std::optional<Detour> way_after_a_wait(Timelines& timelines, const KnownWays& ways, i64 row, i64 step,
                                       View<const i64> waits, const Distances& distances);

// The way by the first of some places from which a body may go on.
//
// It goes there, stays for the first of `waits` that lets it go on, and goes on with the first stop after the step
// `met` in which somebody would be in its way. Where it could stay for as long as ways are known, but is free after
// none of the waits, it stays for `rests` steps; 0: it doesn't, and looks at the whole way only.
std::optional<Detour> way_by_a_place(Timelines& timelines, const KnownWays& ways, const Yielder& body, i64 step,
                                     i64 met, const std::vector<Point>& places, View<const i64> waits, i64 rests,
                                     const Distances& distances);

// Whether another body stays until the step `end` where a body wants to stop next after the step `met`: nearer to that
// stop than `near`.
bool takes_stop(Timelines& timelines, const Yielder& body, i64 step, i64 met, i64 other, i64 near, i64 end);

// A body in the way of another one, and where that one may stand beside it.
struct BodyInWay {
    i64 other;     // the body in the way
    i64 near;      // distance of the middles below which it takes a stop of the other one [lattice units]
    i64 distance;  // at which the other one passes it [lattice units]
    View<const i16, 2> room_of_place;    // -1 for none
    std::function<bool(Point)> can_get;  // whether the other one can get to a point
};

// The way past a body: after the first of some waits that lets it, if that one doesn't stay until the step `end`; else
// by a point beside it, unless it takes the next stop.
std::optional<Detour> way_past(Timelines& timelines, const KnownWays& ways, const Yielder& body, i64 step, i64 met,
                               const BodyInWay& in_way, View<const i64> waits, const Distances& distances, i64 end);

// The way round some discs to the first stop after the moment `met`, from which it goes on. If that stop is taken by a
// disc, it stops at the place that `beside` returns instead; nothing if that is none.
std::optional<Detour> way_round(Timelines& timelines, const Yielder& body, i64 step, i64 met,
                                const std::vector<Disc>& discs,
                                const std::function<std::optional<Point>(Point)>& beside);

// The way on if the body stops where it is, in place of its first stop after the moment `met`; nothing where `may_stop`
// says that it mustn't.
std::optional<Detour> way_from_here(Timelines& timelines, const Yielder& body, i64 step, i64 met,
                                    const std::function<bool(Point)>& may_stop);

// A part of the cells in which a body can be.
struct Cells {
    View<const i32, 2> part_of_cell;
    i64 part;
};

// Where it looks for places: so many cells to each side, every so many cells, and how many.
struct Search {
    i64 within, spacing, most;
};

// The centres of cells that a body can step aside to, the nearest by walking distance first: nobody else comes as near
// as `reach` (bodies,) to them in the steps from `step` to `end`.
std::vector<Point> places_aside(Timelines& timelines, i64 row, i64 step, i64 end, const Cells& cells, Point from,
                                const Search& search, View<const i64> reach);

// Where a body looks for places to step aside to.
struct AsideSearch {
    Cells cells;
    std::function<Point()> from;  // where it begins to look
    i64 near, far;                // cells to each side: first within the near ones
    i64 spacing, most;            // see Search
    View<const i64> reach;        // (bodies,), how near others may come to a place
};

// The way aside and back: that by the first place nearby from which it may go on, else by one farther away; see
// `way_by_a_place`.
std::optional<Detour> way_aside(Timelines& timelines, const KnownWays& ways, const Yielder& body, i64 step, i64 met,
                                const AsideSearch& aside, View<const i64> waits, i64 rests, const Distances& distances);

// Where others stand for so many steps from a step on, or else from the end of them on: by body, the middle and the
// distance in `reach` (bodies,).
std::vector<Disc> standing(Timelines& timelines, i64 row, i64 step, i64 steps, View<const i64> reach);

// Whether a body doesn't leave its place in the steps from `step` to `end` - 1.
bool rests(Timelines& timelines, i64 body, i64 step, i64 end);

}  // namespace fleet2d
