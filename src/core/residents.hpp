// Residents do activities in a home: they go to where each is done, and turn, move about and fetch things there.
//
// Activities, rooms and places at furniture are numbers.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "interruptions.hpp"
#include "legs.hpp"
#include "planner.hpp"

namespace fleet2d {

inline constexpr i64 STANDING = 0;  // the posture of whoever walks

// Where somebody is: at furniture, or on a spot.
struct Place {
    i64 seat;  // the number of the place at furniture; -1: none
    Point spot;
};

// A place at furniture.
struct Seat {
    Point at;  // of the body while it uses it
    i64 heading;
    i64 posture;
    Point approach;  // from where the body steps there
};

// How a room is chosen among several: always the same, the nearest one, any each time, the one where somebody is.
enum class RoomPolicy : i64 { OWN, NEAREST, EACH_TIME, HERE };

// What somebody does now and then within an activity.
enum class MoveKind : i64 { SHIFTS, MOVES, FETCHES };

// A kind of move, and the time between two of them.
using SmallMove = std::pair<MoveKind, std::shared_ptr<Waits>>;

// Where and how somebody does an activity.
struct Venue {
    i64 activity;
    bool away;
    RoomPolicy choose;
    i64 posture;
    std::vector<i64> rooms;
    std::vector<i64> seats;        // none: anywhere in the rooms
    std::vector<i64> stores;       // the rooms from which things are fetched
    std::vector<SmallMove> moves;  // turns on the spot come first
    std::optional<Distribution>
        fetch_takes;  // how long somebody is away to fetch something [s]; none: nothing is fetched
};

// A time in which an activity is done.
struct Stint {
    const Venue* venue;
    i64 number;  // the address of its draws
    i64 end;     // us
    Role role;
    bool stays;  // done wherever somebody is
};

// The stint that was done last.
struct LastStint {
    i64 number = -1;
    std::optional<Place> place;  // where it is done
    std::optional<Place> base;   // where the planned one that it interrupts is done
};

enum class Happening : i64 { ACTIVITY, WAY_BLOCKED, USES, LEFT_HOME, CAME_HOME };

// What happens on the way: `detail` is the number of the activity or of the place at furniture.
struct Note {
    i64 time;
    Happening what;
    i64 detail;
};

// A plan that is being made: its end so far, and what was added to it.
struct Course {
    Legs& legs;
    Moment now;
    i64 posture;
    std::vector<std::pair<i64, i64>> postures;  // when each is taken [us]
    std::vector<Note> notes;

    bool is_at(Point point) const { return !now.away && now.x == point.x && now.y == point.y; }
    void note(Happening what, i64 detail = 0) { notes.push_back({now.time, what, detail}); }
    void take(i64 other);
    void come_home();
    void stay_until(i64 time);
};

// The home, as a resident knows it.
class KnownHome {
public:
    virtual ~KnownHome() = default;
    // Points to stand on in a room, one or more.
    virtual const std::vector<Point>& spots(i64 room) = 0;
    // The places at furniture in a room for an activity.
    virtual const std::vector<i64>& seats(const Venue& venue, i64 room) = 0;
    virtual const Seat& seat(i64 number) = 0;
    // The room for an activity that is nearest to a point.
    virtual i64 nearest(const Venue& venue, Point at) = 0;
    // The room that holds a point; -1: none.
    virtual i64 room_at(Point at) = 0;
    // How long to wait before a room may be used for a time [us]; none: not now.
    virtual std::optional<i64> wait(i64 room, i64 now, i64 takes) = 0;
    virtual Point way_out() = 0;
    // Where somebody steps first who leaves a point: off the furniture there, else the same point.
    virtual Point step_off(Point at) = 0;
    // The points of the shortest route; none where there is none, or an end isn't strictly inside.
    virtual std::vector<Point> route(Point from, Point to) = 0;
    // Whether routes are all that it takes to get somewhere.
    virtual bool has_routes() const = 0;
    // Go to a place where no route is known, and settle there.
    virtual void walk(Course& course, const Place& place) = 0;
};

class Resident {
public:
    Resident(KnownHome& home, Course& course, f64 speed, f64 turn_rate)
        : home_(home), course_(course), speed_(speed), turn_rate_(turn_rate) {}

    // Do what is planned, one stint after the other, as long as the course ends before `until` and no stint is
    // blocked. With `continues`, the first one may be a part of the last one that was done. `key` is of the stream.
    void live(const std::vector<Stint>& stints, u64 key, i64 until, bool continues, LastStint& last);

    // Go to where an activity is done, and take its posture.
    Place go(const Venue& venue, StepDraws& draws);

private:
    bool do_stint(const Stint& stint, u64 key, i64 began, bool continues, LastStint& last);
    Place move_about(const Venue& venue, Place place, i64 end, StepDraws& draws);
    Place go_elsewhere(const Venue& venue, const Place& place, StepDraws& draws);
    void fetch(const Venue& venue, const Place& place, i64 end, StepDraws& draws);
    Place stay_in_room(const Venue& venue, StepDraws& draws);
    void settle(const Venue& venue, const Place& place);
    void walk(const Place& place);
    bool walk_route(Point to);
    void leave_home();

    KnownHome& home_;
    Course& course_;
    f64 speed_, turn_rate_;
};

}  // namespace fleet2d
