#include "../residents.hpp"

#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <bit>
#include <map>

#include "arrays.hpp"
#include "distributions.hpp"
#include "legs.hpp"
#include "routes.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

constexpr i64 LONGEST_STINT = i64{1} << 38;  // us: else there might be small moves by the million
constexpr i64 MAX_POSTURES = 128;
constexpr u64 MAX_MOVES = 3;

using PlaceRow = std::tuple<i64, i64, i64>;
using LastRow = std::tuple<i64, std::optional<PlaceRow>, std::optional<PlaceRow>>;
using NoteRow = std::tuple<i64, i64, i64>;
using CourseRow = std::tuple<MomentRow, i64, std::vector<std::pair<i64, i64>>, std::vector<NoteRow>>;

Point point_of(i64 x, i64 y) {
    checked(0, x, y, 0, 0);
    return {x, y};
}

i64 checked_posture(i64 number) {
    require(0 <= number && number < MAX_POSTURES, "postures must be 0 to 127");
    return number;
}

std::optional<Place> place_of(const std::optional<PlaceRow>& row) {
    if (!row) return std::nullopt;
    const auto [seat, x, y] = *row;
    require(seat >= -1, "places at furniture must be -1 or more");
    return Place{seat, point_of(x, y)};
}

std::optional<PlaceRow> plain(const std::optional<Place>& place) {
    if (!place) return std::nullopt;
    return PlaceRow{place->seat, place->spot.x, place->spot.y};
}

Waits waits_of(View<const i64> quantiles) {
    require(std::has_single_bit(static_cast<u64>(quantiles.size())) && quantiles.size() <= i64{1} << Bits::MOST &&
                all_in_range(quantiles, 0, LATEST) &&
                std::any_of(quantiles.begin(), quantiles.end(), [](i64 wait) { return wait > 0; }),
            "waits must be a power of two of times of 0 us or more, not all 0");
    return {{quantiles.begin(), quantiles.end()}};
}

// A venue, and what Python knows it by.
struct OwnedVenue : Venue {
    nb::object asked_with;
    // What was asked for: places at furniture by room, and the nearest room by point.
    mutable std::map<i64, Numbers> seats_in;
    mutable std::map<std::pair<i64, i64>, i64> nearest_to;
};

OwnedVenue venue_of(nb::object asked_with, i64 activity, bool away, i64 choose, i64 posture, Numbers rooms,
                    Numbers seats, Numbers stores, const std::vector<std::pair<i64, std::shared_ptr<Waits>>>& moves,
                    const std::optional<DistributionRow>& fetch_takes) {
    require(0 <= choose && choose <= static_cast<i64>(RoomPolicy::HERE), "choose must be 0 to 3");
    require(!away || moves.empty(), "somebody who is away makes no small moves");
    OwnedVenue venue{{activity,
                      away,
                      static_cast<RoomPolicy>(choose),
                      checked_posture(posture),
                      std::move(rooms),
                      std::move(seats),
                      std::move(stores),
                      {},
                      std::nullopt},
                     std::move(asked_with),
                     {},
                     {}};
    require(moves.size() <= MAX_MOVES, "there are three kinds of small moves");
    for (const auto& [kind, waits] : moves) {
        require(0 <= kind && kind <= static_cast<i64>(MoveKind::FETCHES), "kinds of moves must be 0 to 2");
        require(kind != static_cast<i64>(MoveKind::SHIFTS) || venue.moves.empty(), "turns come before other moves");
        require(waits != nullptr, "moves must have times between them");
        venue.moves.emplace_back(static_cast<MoveKind>(kind), waits);
    }
    if (fetch_takes) venue.fetch_takes = distribution_of(*fetch_takes);
    require(!venue.fetch_takes || venue.fetch_takes->shortest >= 0, "to fetch something must take 0 s or more");
    return venue;
}

// A resident, and what is known of the home, as it was asked for.
struct OwnedResident {
    u64 key;
    f64 speed, turn_rate;
    nb::object owner;  // of the routes
    Routes* routes;    // none: Python finds all ways
    std::map<std::pair<i64, i64>, Point> steps_off;
    std::map<i64, std::vector<Point>> spots;
    std::map<i64, Seat> seats;
    std::map<std::pair<i64, i64>, i64> rooms_at;
    std::optional<Point> way_out;
};

OwnedResident resident_of(u64 key, f64 speed, f64 turn_rate, nb::object routes,
                          const std::vector<std::tuple<i64, i64, i64, i64>>& steps_off) {
    check_rates(speed, turn_rate);
    Routes* ways = routes.is_none() ? nullptr : &nb::cast<Routes&>(routes);
    OwnedResident resident{key, speed, turn_rate, std::move(routes), ways, {}, {}, {}, {}, {}};
    for (const auto& [x, y, to_x, to_y] : steps_off) {
        point_of(x, y);
        resident.steps_off.emplace(std::pair(x, y), point_of(to_x, to_y));
    }
    return resident;
}

CourseRow take_row(Course& course) {
    std::vector<NoteRow> notes;
    for (const Note& note : course.notes) notes.emplace_back(note.time, static_cast<i64>(note.what), note.detail);
    course.notes.clear();
    return {plain(course.now), course.posture, std::exchange(course.postures, {}), std::move(notes)};
}

// The home, as Python knows it; what it answers is kept where it stays the same.
class AskedHome final : public KnownHome {
public:
    AskedHome(OwnedResident& own, nb::handle home, nb::handle walk) : own_(own), home_(home), walk_(walk) {}

    const std::vector<Point>& spots(i64 room) override {
        std::vector<Point>& spots = own_.spots[room];
        if (spots.empty()) {
            using Rows = std::vector<std::pair<i64, i64>>;
            for (const auto& [x, y] : nb::cast<Rows>(home_.attr("spots")(room))) spots.push_back(point_of(x, y));
            require(!spots.empty(), "a room must have a spot");
        }
        return spots;
    }
    const Numbers& seats(const Venue& venue, i64 room) override {
        const auto& own = static_cast<const OwnedVenue&>(venue);
        const auto known = own.seats_in.find(room);
        if (known != own.seats_in.end()) return known->second;
        return own.seats_in[room] = nb::cast<Numbers>(home_.attr("seats")(own.asked_with, room));
    }
    const Seat& seat(i64 number) override {
        const auto known = own_.seats.find(number);
        if (known != own_.seats.end()) return known->second;
        using SeatRow = std::tuple<i64, i64, i64, i64, i64, i64>;
        const auto [x, y, heading, posture, from_x, from_y] = nb::cast<SeatRow>(home_.attr("seat")(number));
        checked(0, x, y, heading, 0);
        return own_.seats[number] = {{x, y}, heading, checked_posture(posture), point_of(from_x, from_y)};
    }
    i64 nearest(const Venue& venue, Point at) override {
        const auto& own = static_cast<const OwnedVenue&>(venue);
        return known(own.nearest_to, at, [&] { return home_.attr("nearest")(own.asked_with, at.x, at.y); });
    }
    i64 room_at(Point at) override {
        return known(own_.rooms_at, at, [&] { return home_.attr("room_at")(at.x, at.y); });
    }
    std::optional<i64> wait(i64 room, i64 now, i64 takes) override {
        const auto wait = nb::cast<std::optional<i64>>(home_.attr("wait")(room, now, takes));
        require(!wait || (0 <= *wait && *wait <= LATEST), "waits must be 0 us or more");
        return wait;
    }
    Point way_out() override {
        if (!own_.way_out) {
            const auto [x, y] = nb::cast<std::pair<i64, i64>>(home_.attr("way_out")());
            own_.way_out = point_of(x, y);
        }
        return *own_.way_out;
    }
    Point step_off(Point at) override {
        const auto off = own_.steps_off.find({at.x, at.y});
        return off == own_.steps_off.end() ? at : off->second;
    }
    std::vector<Point> route(Point from, Point to) override {
        return own_.routes ? own_.routes->find(from, to) : std::vector<Point>{};
    }
    bool has_routes() const override { return own_.routes != nullptr; }
    void walk(Course& course, const Place& place) override {
        const auto row = nb::make_tuple(place.seat, place.spot.x, place.spot.y);
        const auto [now, posture] = nb::cast<std::pair<MomentRow, i64>>(walk_(take_row(course), row));
        course.now = std::apply(checked, now);
        course.posture = checked_posture(posture);
    }

private:
    using ByPoint = std::map<std::pair<i64, i64>, i64>;

    // The room of a point, which is asked for once.
    template <class Ask>
    static i64 known(ByPoint& rooms, Point at, Ask ask) {
        const auto room = rooms.find({at.x, at.y});
        if (room != rooms.end()) return room->second;
        return rooms[{at.x, at.y}] = nb::cast<i64>(ask());
    }

    OwnedResident& own_;
    nb::handle home_, walk_;
};

using StintRow = std::tuple<const OwnedVenue*, i64, i64, i64, bool>;

std::vector<Stint> stints_of(const std::vector<StintRow>& rows, i64 now) {
    std::vector<Stint> stints;
    for (const auto& [venue, number, end, role, stays] : rows) {
        require(venue != nullptr, "a stint must have a venue");
        require(0 <= number && number < LATEST, "numbers of stints must be 0 to 2**61");
        require(end <= LATEST && end - now < LONGEST_STINT, "stints must end within 2**38 us");
        require(0 <= role && role <= static_cast<i64>(Role::FINISHES), "roles must be 0 to 3");
        stints.push_back({venue, number, end, static_cast<Role>(role), stays});
    }
    return stints;
}

CourseRow live(OwnedResident& self, nb::object home, nb::object walk, Legs& legs, MomentRow now, i64 posture,
               const std::vector<StintRow>& stints, i64 until, bool continues, LastStint& last) {
    AskedHome asked(self, home, walk);
    Course course{legs, std::apply(checked, now), checked_posture(posture), {}, {}};
    Resident resident(asked, course, self.speed, self.turn_rate);
    resident.live(stints_of(stints, course.now.time), self.key, until, continues, last);
    return take_row(course);
}

CourseRow go(OwnedResident& self, nb::object home, nb::object walk, Legs& legs, MomentRow now, i64 posture,
             const OwnedVenue& venue, StepDraws& draws) {
    require(!venue.rooms.empty(), "the venue must have a room");
    AskedHome asked(self, home, walk);
    Course course{legs, std::apply(checked, now), checked_posture(posture), {}, {}};
    Resident(asked, course, self.speed, self.turn_rate).go(venue, draws);
    return take_row(course);
}

}  // namespace

void bind_residents(nb::module_& m) {
    nb::enum_<RoomPolicy>(m, "RoomPolicy", "How a room is chosen among several.")
        .value("OWN", RoomPolicy::OWN, "The same each time.")
        .value("NEAREST", RoomPolicy::NEAREST, "The nearest one.")
        .value("EACH_TIME", RoomPolicy::EACH_TIME, "Any, drawn each time.")
        .value("HERE", RoomPolicy::HERE, "The one where somebody is.");
    nb::enum_<MoveKind>(m, "MoveKind", "What somebody does now and then within an activity; of several due, the first.")
        .value("SHIFTS", MoveKind::SHIFTS, "Turns on the spot.")
        .value("MOVES", MoveKind::MOVES, "Goes to another spot of the room, or to the furniture.")
        .value("FETCHES", MoveKind::FETCHES, "Goes to another room, and comes back.");
    nb::enum_<Happening>(m, "Happening", "What happens on the way.")
        .value("ACTIVITY", Happening::ACTIVITY, "An activity begins.")
        .value("WAY_BLOCKED", Happening::WAY_BLOCKED, "No way leads to it.")
        .value("USES", Happening::USES, "Furniture is used.")
        .value("LEFT_HOME", Happening::LEFT_HOME, "The home is left.")
        .value("CAME_HOME", Happening::CAME_HOME, "The home is entered.");

    nb::class_<Waits>(m, "Waits", R"(Times between two events.

Args:
    quantiles: int64 (n,), quantiles [us]; n is a power of two.)")
        .def(
            "__init__", [](Waits* self, View<const i64> quantiles) { new (self) Waits(waits_of(quantiles)); },
            "quantiles"_a);

    nb::class_<OwnedVenue>(m, "CoreVenue", R"(Where and how somebody does an activity.

Args:
    asked_with: What `seats` and `nearest` of the home are asked with.
    activity: The number of the activity.
    away: Whether it is done out of the home.
    choose: How a room is chosen: 0 the same each time, 1 the nearest, 2 any, 3 the one where somebody is.
    posture: The number of the posture; 0 is standing.
    rooms: The rooms where it is done; none: it is blocked, or out of the home.
    seats: The places at furniture where it is done; none: anywhere in the rooms.
    stores: The rooms from which things are fetched.
    moves: The kind of each small move, 0 turns, 1 walks, 2 trips to fetch something, and the times between them.
    fetch_takes: The distribution of how long somebody is away to fetch something [s]; None: nothing is fetched.)")
        .def(
            "__init__",
            [](OwnedVenue* self, nb::object asked_with, i64 activity, bool away, i64 choose, i64 posture, Numbers rooms,
               Numbers seats, Numbers stores, const std::vector<std::pair<i64, std::shared_ptr<Waits>>>& moves,
               const std::optional<DistributionRow>& fetch_takes) {
                new (self) OwnedVenue(venue_of(std::move(asked_with), activity, away, choose, posture, std::move(rooms),
                                               std::move(seats), std::move(stores), moves, fetch_takes));
            },
            "asked_with"_a.none(), "activity"_a, "away"_a, "choose"_a, "posture"_a, "rooms"_a, "seats"_a, "stores"_a,
            "moves"_a, "fetch_takes"_a.none());

    nb::class_<LastStint>(m, "LastStint", "What somebody did last, where, and what that interrupted.")
        .def(nb::init<>())
        .def("__getstate__",
             [](const LastStint& self) { return LastRow{self.number, plain(self.place), plain(self.base)}; })
        .def("__setstate__", [](LastStint& self, LastRow row) {
            const auto& [number, place, base] = row;
            new (&self) LastStint{number, place_of(place), place_of(base)};
        });

    nb::class_<OwnedResident>(m, "Resident", R"(Somebody who does activities in a home.

Args:
    key: Of the stream of draws.
    speed: Lattice units a second.
    turn_rate: Headings a second.
    routes: Routes of the home; None: `walk` finds all ways.
    steps_off: Points on furniture, and where somebody steps first who leaves them: x, y, x, y [lattice].)")
        .def(
            "__init__",
            [](OwnedResident* self, u64 key, f64 speed, f64 turn_rate, nb::object routes,
               const std::vector<std::tuple<i64, i64, i64, i64>>& steps_off) {
                new (self) OwnedResident(resident_of(key, speed, turn_rate, std::move(routes), steps_off));
            },
            nb::sig(
                "def __init__(self, key: int | numpy.uint64, speed: float, turn_rate: float, routes: Routes | None, "
                "steps_off: collections.abc.Sequence[tuple[int, int, int, int]]) -> None"),
            "key"_a, "speed"_a, "turn_rate"_a, "routes"_a.none(), "steps_off"_a)
        .def("live", &live, "home"_a, "walk"_a, "legs"_a, "now"_a, "posture"_a, "stints"_a, "until"_a, "continues"_a,
             "last"_a,
             R"(Do activities, one after the other, until the last one is over or one is blocked.

Args:
    home: What is asked about the home: spots(room), seats(asked_with, room), seat(number), nearest(asked_with, x, y),
        room_at(x, y), wait(room, now, takes) and way_out().
    walk: Goes to a place where no route is known: from what this returns, and the place's number at furniture, or -1,
        x and y, it returns the new end of the plan, and the posture.
    legs: Where breakpoints are added.
    now: The end of the plan: time [us], x, y [lattice], heading [1/4096 turn], away.
    posture: The posture then.
    stints: Venue, address of draws, end [us], role, and whether it is done wherever somebody is, of each.
    until: After that, none begins [us].
    continues: Whether the first one may be a part of the last one.
    last: What was done last; it is updated.

Returns:
    The new end of the plan; the posture; when postures are taken; time, kind and detail of what happens: 0 an activity
    begins, 1 the way is blocked, 2 furniture is used, 3 the home is left, 4 or entered.)")
        .def("go", &go, "home"_a, "walk"_a, "legs"_a, "now"_a, "posture"_a, "venue"_a, "draws"_a,
             "Go to where an activity is done, and take its posture; see `live`.");
}

}  // namespace fleet2d
