#include "coverage.hpp"

#include <algorithm>
#include <stdexcept>

#include "lanes.hpp"
#include "visible_cells.hpp"

namespace fleet2d {
namespace {

constexpr i64 FARTHEST_BODY = i64{1} << 40;  // lattice units: nobody who is further out sees a home

// The key of a pose in the cache.
struct Stance {
    i64 x, y, heading;
    i64 panned;  // how far the cameras are panned

    bool operator==(const Stance&) const = default;
};

// One number for the pan positions of all cameras.
i64 panned_at(const Lenses& lenses, i64 moment_us) {
    u64 number = 0;
    for (i64 camera = 0; camera < lenses.pan_count.size(); ++camera) {
        const i64 count = lenses.pan_count[camera];
        if (count == 0) continue;
        const i64 turn = floor_mod(floor_div(moment_us, lenses.pan_us[camera]), count);
        number = number * static_cast<u64>(count) + static_cast<u64>(turn);
    }
    return static_cast<i64>(number);
}

// The slot that holds the number of a pose, or the empty one that it would go to.
i32& slot_of(const PoseCache& cache, const Stance& stance) {
    u64 hash = static_cast<u64>(stance.x) * 0x9E3779B97F4A7C15;
    hash ^= static_cast<u64>(stance.y) * 0xC2B2AE3D27D4EB4F;
    hash ^= static_cast<u64>(stance.panned) * TURN + static_cast<u64>(stance.heading);
    hash *= 0x165667B19E3779F9;
    const i64 mask = cache.slots() - 1;
    i64 slot = static_cast<i64>(hash >> 33) & mask;
    for (i64 tried = 0; tried <= mask; ++tried, slot = (slot + 1) & mask) {
        i32& number = cache.number[slot];
        if (number == NEVER) return number;
        if (number < 0 || number >= cache.used[0]) break;
        const View<i64> pose = cache.pose[number];
        if (Stance{pose[0], pose[1], pose[2], pose[3]} == stance) return number;
    }
    throw std::invalid_argument("more slots of cache are used than `used` says");
}

// The cells of a span.
template <class T>
View<T> cells_of(View<T, 2> grid, const Span& span) {
    return grid[span.row].slice(span.first, span.last + 1);
}

// Where the runs of equal numbers in the rows of a grid end; each row is looked through when it is first needed.
class RunEnds {
public:
    explicit RunEnds(View<const i16, 2> grid)
        : grid_(grid), ends_(Array<i32, 2>::empty(grid.shape)), known_(Array<bool>::zeros({grid.size()})) {}

    // (columns,) one past the last number of the run that each belongs to.
    View<const i32> of(i64 row) {
        const View<i32> ends = ends_.view()[row];
        if (known_.view()[row]) return ends;
        known_.view()[row] = true;
        const View<const i16> numbers = grid_[row];
        for (i64 i = numbers.size() - 1; i >= 0; --i) {
            const bool goes_on = i + 1 < numbers.size() && numbers[i] == numbers[i + 1];
            ends[i] = goes_on ? ends[i + 1] : static_cast<i32>(i + 1);
        }
        return ends;
    }

private:
    View<const i16, 2> grid_;
    Array<i32, 2> ends_;
    Array<bool> known_;
};

// Add cells of one patch, -1 for none.
void count_cells(i64 patch, i64 count, View<i32> cells) {
    if (patch < 0) return;
    if (patch >= cells.size()) throw std::invalid_argument("patch_of_cell must hold patches, or -1");
    cells[patch] += static_cast<i32>(count);
}

// Finds the cells that a robot's cameras show.
class CameraCells {
public:
    explicit CameraCells(const CoverageSetup& setup)
        : setup_(setup), finder_(setup.walls, setup.patch_of_cell.shape[0], setup.patch_of_cell.shape[1]) {}

    // The cells that one camera shows from a pose of the robot; valid until the next call.
    const std::vector<Span>& of(i64 camera, View<const i64> pose, i64 step) {
        const Lenses& lenses = setup_.lenses;
        const auto clamped = [](i64 coordinate) { return std::clamp(coordinate, -FARTHEST_BODY, FARTHEST_BODY); };
        const Pose robot{clamped(pose[0]), clamped(pose[1]), pose[2] & (TURN - 1)};
        return finder_.cells_in_view(
            camera_pose(lenses, camera, robot, step * setup_.step_us),
            {lenses.near_squared[camera], lenses.far_squared[camera], lenses.half_angle[camera]});
    }

private:
    const CoverageSetup& setup_;
    CellFinder finder_;
};

void settle_coverage(const CoverageSetup& setup, const PoseCache& cache, View<i64, 2> seen, CameraCells& cells) {
    for (i64 number = 0; number < cache.used[0]; ++number) {
        const i64 step = cache.last[number];
        if (step == cache.settled[number]) continue;
        if (step < 0 || step > LAST_MOMENT / setup.step_us) throw std::invalid_argument("last must hold steps, or -1");
        cache.settled[number] = step;
        for (i64 camera = 0; camera < setup.cameras(); ++camera) {
            for (const Span& span : cells.of(camera, cache.pose[number], step)) {
                for (i64& last : cells_of(seen, span)) last = std::max(last, step);
            }
        }
    }
}

// Processes runs of equal pose one after the other. It holds the present pose until the next one.
class CoverageRecorder {
public:
    CoverageRecorder(const CoverageSetup& setup, const PoseCache& cache, const CoverageRecord& record)
        : setup_(setup), cache_(cache), record_(record), cells_(setup), run_ends_(setup.patch_of_cell) {}

    void record(const Window& window, i64 body, i64 first, i64 end);

private:
    // Hold another pose.
    void take(const Stance& stance, i64 step);

    // Look from a new pose: mark what was never seen before, and count the cells of each patch.
    void look_from(i64 number, i64 step);
    void mark(const Span& span, i64 step, View<i32> cells);

    // Add the view of the held pose for the looks not added yet; `bin` is a row of CoverageRecord::binned.
    void add_held(i64 bin);

    // Add cells of patches to their sums, and keep the most of them; the arrays don't overlap.
    static void add_view(i64 patches, const i32* cells, i64 steps, i64* exposure, i64* binned, i64* peak);

    // Set the bins before `bin` that nothing was added to.
    void leave_empty(i64 bin);

    const CoverageSetup& setup_;
    const PoseCache& cache_;
    const CoverageRecord& record_;
    CameraCells cells_;
    RunEnds run_ends_;
    Stance held_{};
    i64 number_ = -1;  // of the held pose; -1 for none
    i64 looks_ = 0;    // that aren't added yet
    i64 last_look_ = NEVER;
    i64 begun_ = 0;  // bins that are set
};

void CoverageRecorder::take(const Stance& stance, i64 step) {
    if (cache_.used[0] >= cache_.poses()) {
        if (record_.keeps_last()) settle_coverage(setup_, cache_, record_.last, cells_);
        std::fill(cache_.number.begin(), cache_.number.end(), static_cast<i32>(NEVER));
        cache_.used[0] = 0;
    }
    held_ = stance;
    i32& number = slot_of(cache_, stance);
    if (number != NEVER) {
        number_ = number;
        return;
    }
    number_ = cache_.used[0];
    const View<i64> pose = cache_.pose[number_];
    pose[0] = stance.x, pose[1] = stance.y, pose[2] = stance.heading, pose[3] = stance.panned;
    look_from(number_, step);
    cache_.last[number_] = cache_.settled[number_] = step;
    number = static_cast<i32>(number_);
    ++cache_.used[0];
}

void CoverageRecorder::look_from(i64 number, i64 step) {
    const View<i32> cells = cache_.cells[number];
    std::fill(cells.begin(), cells.end(), 0);
    for (i64 camera = 0; camera < setup_.cameras(); ++camera) {
        for (const Span& span : cells_.of(camera, cache_.pose[number], step)) mark(span, step, cells);
    }
    i64 first = 0, end = cells.size();
    while (first < end && cells[first] == 0) ++first;
    while (end > first && cells[end - 1] == 0) --end;
    cache_.shown(number, 0) = static_cast<i32>(first), cache_.shown(number, 1) = static_cast<i32>(end);
}

void CoverageRecorder::mark(const Span& span, i64 step, View<i32> cells) {
    if (record_.keeps_first()) {
        for (i64& first : cells_of(record_.first, span)) first = first == NEVER ? step : first;
    }
    if (record_.keeps_last()) std::ranges::fill(cells_of(record_.last, span), step);
    if (setup_.cameras() == 1) {
        const View<const i32> ends = run_ends_.of(span.row);
        for (i64 column = span.first, end = 0; column <= span.last; column = end) {
            end = std::min(i64{ends[column]}, i64{span.last} + 1);
            count_cells(setup_.patch_of_cell(span.row, column), end - column, cells);
        }
        return;
    }
    const View<const i16> patches = cells_of(setup_.patch_of_cell, span);
    const View<i64> counted = cells_of(record_.counted, span);
    for (i64 i = 0; i < patches.size(); ++i) {
        if (counted[i] == step) continue;  // another camera shows it, too
        counted[i] = step;
        count_cells(patches[i], 1, cells);
    }
}

void CoverageRecorder::add_held(i64 bin) {
    if (number_ < 0) return;
    cache_.last[number_] = last_look_;
    const i64 steps = looks_ * setup_.every, first = cache_.shown(number_, 0), end = cache_.shown(number_, 1);
    if (first < 0 || end > record_.patches()) throw std::invalid_argument("shown must hold ranges of patches");
    const i32* cells = cache_.cells[number_].data + first;
    if (!record_.keeps_bins()) {
        for (i64 i = 0; i < end - first; ++i) record_.exposure[first + i] += steps * cells[i];
        return;
    }
    if (steps == 0) return;
    if (begun_ <= bin) leave_empty(bin + 1);
    side_by_side<1>([&] {
        add_view(end - first, cells, steps, record_.exposure.data + first, record_.binned[bin].data + first,
                 record_.peak[bin].data + first);
    });
}

void CoverageRecorder::add_view(i64 patches, const i32* __restrict cells, i64 steps, i64* __restrict exposure,
                                i64* __restrict binned, i64* __restrict peak) {
    if (steps == 1) {  // a robot that walks
        for (i64 i = 0; i < patches; ++i) {
            const i64 count = cells[i];
            exposure[i] += count;
            binned[i] += count;
            peak[i] = std::max(peak[i], count);
        }
        return;
    }
    for (i64 i = 0; i < patches; ++i) {
        const i64 count = cells[i];
        exposure[i] += steps * count;
        binned[i] += steps * count;
        peak[i] = std::max(peak[i], count);
    }
}

void CoverageRecorder::leave_empty(i64 bin) {
    for (; begun_ < bin; ++begun_) {
        std::ranges::fill(record_.binned[begun_], 0);
        std::ranges::fill(record_.peak[begun_], 0);
    }
}

void CoverageRecorder::record(const Window& window, i64 body, i64 first, i64 end) {
    const i64 every = setup_.every, bin_steps = setup_.bin_steps;
    const bool bins = record_.keeps_bins();
    const bool pans = std::any_of(setup_.lenses.pan_count.begin(), setup_.lenses.pan_count.end(),
                                  [](i64 headings) { return headings > 0; });
    const auto next_look = [every](i64 step) { return every == 1 ? step : next_multiple(step, every); };
    const i64 first_bin = floor_div(first, bin_steps);
    i64 bin = 0, next_bin = (first_bin + 1) * bin_steps;
    for (i64 run = window.start[body]; run < window.start[body + 1]; ++run) {
        const i64 begin = std::max(first, window.step[run]), stop = std::min(end, window.run_end(body, run));
        if (window.away[run] != 0) {
            add_held(bin);
            number_ = -1, looks_ = 0;
            continue;
        }
        for (i64 step = next_look(begin); step < stop;) {
            if (bins && step >= next_bin) {
                add_held(bin);
                looks_ = 0;
                bin = floor_div(step, bin_steps) - first_bin;
                next_bin = (first_bin + bin + 1) * bin_steps;
            }
            const i64 panned = pans ? panned_at(setup_.lenses, step * setup_.step_us) : 0;
            const Stance stance{window.x[run], window.y[run], window.heading[run], panned};
            if (number_ < 0 || stance != held_) {
                add_held(bin);
                looks_ = 0;
                take(stance, step);
            }
            const i64 until = pans ? step + 1 : bins ? std::min(stop, next_bin) : stop;
            const i64 next = next_look(until);
            looks_ += every == 1 ? next - step : (next - step) / every;
            last_look_ = next - every;
            step = next;
        }
    }
    add_held(bin);
    if (!bins || first == end) return;
    leave_empty(floor_div(end - 1, bin_steps) - first_bin + 1);
}

}  // namespace

void record_coverage(const CoverageSetup& setup, const Window& window, i64 body, i64 first, i64 end,
                     const PoseCache& cache, const CoverageRecord& record) {
    CoverageRecorder(setup, cache, record).record(window, body, first, end);
}

void settle_coverage(const CoverageSetup& setup, const PoseCache& cache, View<i64, 2> seen) {
    CameraCells cells(setup);
    settle_coverage(setup, cache, seen, cells);
}

}  // namespace fleet2d
