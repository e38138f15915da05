#include "residents.hpp"

#include <algorithm>
#include <tuple>

#include "routes.hpp"

namespace fleet2d {
namespace {

constexpr i64 SECOND = 1'000'000;         // us
constexpr i64 NEARLY_OVER = 90 * SECOND;  // before the end of a stint in which no small move begins
constexpr u64 AFTER_MIDNIGHT = 512;       // added to the address of draws for the part after midnight
constexpr u64 SIDE_BITS = 10;             // turns aside are up to an eighth of a turn
constexpr i64 ANY = i64{1} << 62;         // above all values of a distribution

template <class T>
const T& chosen(const std::vector<T>& options, StepDraws& draws) {
    return options[static_cast<std::size_t>(draws.below(options.size()))];
}

}  // namespace

void Course::take(i64 other) {
    if (other == posture) return;
    postures.emplace_back(now.time, other);
    posture = other;
}

void Course::come_home() {
    if (!now.away) return;
    now.away = 0;
    note(Happening::CAME_HOME);
    legs.mark(now);
}

void Course::stay_until(i64 time) {
    if (time <= now.time) return;
    now.time = time;
    legs.mark(now);
}

void Resident::live(const std::vector<Stint>& stints, u64 key, i64 until, bool continues, LastStint& last) {
    const i64 began = course_.now.time;
    for (const Stint& stint : stints) {
        if (course_.now.time >= until) return;
        if (course_.now.time >= stint.end) continue;  // the way to the last one took longer than this one lasts
        if (!do_stint(stint, key, began, continues, last)) return;
    }
}

bool Resident::do_stint(const Stint& stint, u64 key, i64 began, bool continues, LastStint& last) {
    const Venue& venue = *stint.venue;
    if (venue.rooms.empty() && !venue.away) {
        if (course_.now.time <= began) {
            course_.note(Happening::WAY_BLOCKED, venue.activity);
            course_.stay_until(stint.end);
        }
        return false;
    }
    const bool is_continued = continues && last.number == stint.number;
    StepDraws draws(key, static_cast<u64>(stint.number) + (is_continued ? AFTER_MIDNIGHT : 0));
    if (!is_continued) {
        last.place.reset();
        if (stint.role == Role::PLANNED) last.base.reset();
        if (venue.away) {
            leave_home();
        } else if (!stint.stays) {
            if (stint.role == Role::RESUMES && last.base) {
                last.place = last.base;
                settle(venue, *last.base);
            } else {
                last.place = go(venue, draws);
            }
            if (stint.role == Role::PLANNED) last.base = last.place;
        }
        course_.note(Happening::ACTIVITY, venue.activity);
    }
    if (last.place && !venue.moves.empty()) last.place = move_about(venue, *last.place, stint.end, draws);
    last.number = stint.number;
    course_.stay_until(stint.end);
    return true;
}

Place Resident::go(const Venue& venue, StepDraws& draws) {
    if (venue.choose == RoomPolicy::HERE) return stay_in_room(venue, draws);
    const std::vector<i64>* seats = &venue.seats;
    std::vector<i64> nearest;
    if (venue.choose == RoomPolicy::NEAREST && venue.rooms.size() > 1) {
        nearest.push_back(home_.nearest(venue, {course_.now.x, course_.now.y}));
        seats = &home_.seats(venue, nearest[0]);
    }
    const i64 room = chosen(nearest.empty() ? venue.rooms : nearest, draws);
    if (venue.choose == RoomPolicy::EACH_TIME) seats = &home_.seats(venue, room);
    const Place place = seats->empty() ? Place{-1, chosen(home_.spots(room), draws)} : Place{chosen(*seats, draws), {}};
    settle(venue, place);
    return place;
}

// Use the furniture of the room, or else stay on the spot.
Place Resident::stay_in_room(const Venue& venue, StepDraws& draws) {
    course_.come_home();
    const Point at{course_.now.x, course_.now.y};
    const i64 room = home_.room_at(at);
    Place place{-1, at};
    if (room >= 0) {
        const std::vector<i64>& seats = home_.seats(venue, room);
        if (!seats.empty()) place.seat = chosen(seats, draws);
    }
    settle(venue, place);
    return place;
}

// Turn, move and fetch things until the stint is nearly over; returns the place at the end.
Place Resident::move_about(const Venue& venue, Place place, i64 end, StepDraws& draws) {
    Moment& now = course_.now;
    Bits bits;
    std::vector<i64> next;
    for (const auto& [kind, waits] : venue.moves) next.push_back(now.time + waits->draw(draws, bits));
    i64 facing = now.heading;
    end -= NEARLY_OVER;
    while (true) {
        const auto due = std::min_element(next.begin(), next.end());
        if (*due >= end) return place;
        const auto& [kind, waits] = venue.moves[static_cast<std::size_t>(due - next.begin())];
        if (kind == MoveKind::SHIFTS) {  // the first of the moves, also of those due at once
            i64 until = end;
            for (std::size_t i = 1; i < next.size(); ++i) until = std::min(until, next[i] + 1);
            const Aside aside{facing, SIDE_BITS, *waits};
            std::tie(now, *due) = course_.legs.turn_aside(now, turn_rate_, aside, *due, until, draws, bits);
            continue;
        }
        course_.stay_until(*due);
        if (kind == MoveKind::MOVES) {
            place = go_elsewhere(venue, place, draws);
        } else {
            fetch(venue, place, end, draws);
        }
        facing = now.heading;
        *due = now.time + waits->draw(draws, bits);
    }
}

// Go from the furniture to a spot in the room, or from a spot to the furniture or another.
Place Resident::go_elsewhere(const Venue& venue, const Place& place, StepDraws& draws) {
    if (!venue.seats.empty() && place.seat < 0) return go(venue, draws);
    const Place spot{-1, chosen(home_.spots(chosen(venue.rooms, draws)), draws)};
    walk(spot);
    return spot;
}

// Go to another room, stay there shortly, and come back, if there is time for it.
void Resident::fetch(const Venue& venue, const Place& place, i64 end, StepDraws& draws) {
    if (venue.stores.empty() || !venue.fetch_takes) return;
    const i64 takes = venue.fetch_takes->draw(draws, ANY) * SECOND;
    const i64 room = chosen(venue.stores, draws);
    const Point spot = chosen(home_.spots(room), draws);
    const std::optional<i64> wait = home_.wait(room, course_.now.time, takes);
    if (!wait || course_.now.time + *wait + takes >= end) return;
    course_.stay_until(course_.now.time + *wait);
    walk({-1, spot});
    course_.now.time += takes;
    course_.legs.mark(course_.now);
    settle(venue, place);
}

void Resident::leave_home() {
    if (course_.now.away) return;
    const Point out = home_.way_out();
    if (!walk_route(out)) home_.walk(course_, {-1, out});
    course_.now.away = 1;
    course_.note(Happening::LEFT_HOME);
    course_.legs.mark(course_.now);
}

// Go to a place, and take the activity's posture, or else that of the furniture.
void Resident::settle(const Venue& venue, const Place& place) {
    walk(place);
    if (venue.posture != STANDING) course_.take(venue.posture);
}

void Resident::walk(const Place& place) {
    if (place.seat < 0) {
        if (!course_.is_at(place.spot) && !walk_route(place.spot)) home_.walk(course_, place);
        return;
    }
    const Seat& seat = home_.seat(place.seat);
    if (!home_.has_routes() || !(course_.is_at(seat.at) || walk_route(seat.approach))) {
        home_.walk(course_, place);
        return;
    }
    course_.now = course_.legs.settle(course_.now, seat.at, seat.heading, speed_, turn_rate_);
    course_.take(seat.posture);
    course_.note(Happening::USES, place.seat);
}

// Walk the shortest route; returns whether there is one.
bool Resident::walk_route(Point to) {
    const Point from = home_.step_off({course_.now.x, course_.now.y});
    const std::vector<Point> route = home_.route(from, to);
    if (route.empty()) return false;
    course_.come_home();
    course_.take(STANDING);
    const Moment off = course_.legs.step_to(course_.now, from, speed_, turn_rate_);
    course_.now = course_.legs.walk(off, rows_of(route), speed_, turn_rate_);
    return true;
}

}  // namespace fleet2d
