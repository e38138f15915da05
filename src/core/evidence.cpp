#include "evidence.hpp"

#include <algorithm>
#include <cstring>
#include <tuple>
#include <utility>

#include "lanes.hpp"
#include "lattice.hpp"

namespace fleet2d {

namespace {

constexpr f64 PARTS = 255;
constexpr f64 TO_WHOLE = 0x1.8p52;  // adding and taking it away rounds to a whole number, a half to the even one

// Numbers of a row that are equal to those of the row before.
template <class T>
bool same(View<const T> row, View<const T> before) {
    return std::memcmp(row.data, before.data, static_cast<std::size_t>(row.size()) * sizeof(T)) == 0;
}

template <class T>
void repeat(Array<T, 2>& rows, i64 t) {
    const View<T> row = rows[t], before = rows[t - 1];
    std::copy_n(before.data, row.size(), row.data);
}

// The sums of the columns of rows (count, width), each as NumPy's pairwise sum; fewer than 129 rows.
void sum_few_rows(const f64* rows, i64 count, i64 width, f64* sum) {
    constexpr i64 lanes = 8;
    i64 i = 0;
    if (count < lanes) {
        std::fill_n(sum, width, 0.0);
    } else {
        std::vector<f64> parts(rows, rows + lanes * width);
        f64* part = parts.data();
        for (i = lanes; i < count - count % lanes; i += lanes) {
            for (i64 k = 0; k < lanes * width; ++k) part[k] += rows[i * width + k];
        }
        for (i64 k = 0; k < width; ++k) {
            const auto lane = [&](i64 number) { return part[number * width + k]; };
            sum[k] = ((lane(0) + lane(1)) + (lane(2) + lane(3))) + ((lane(4) + lane(5)) + (lane(6) + lane(7)));
        }
    }
    for (; i < count; ++i) {
        for (i64 k = 0; k < width; ++k) sum[k] += rows[i * width + k];
    }
}

// The same of any number of rows: halves of more than 128 apart.
void sum_rows(const f64* rows, i64 count, i64 width, f64* sum) {
    if (count <= 128) {
        sum_few_rows(rows, count, width, sum);
        return;
    }
    i64 half = count / 2;
    half -= half % 8;
    std::vector<f64> rest(static_cast<std::size_t>(width));
    sum_rows(rows, half, width, sum);
    sum_rows(rows + half * width, count - half, width, rest.data());
    for (i64 k = 0; k < width; ++k) sum[k] += rest[static_cast<std::size_t>(k)];
}

// Set one bin's shares from its cells (robots, 2, patches).
void share(View<const i64, 3> cells, const PatchSizes& patches, i64 bin_steps, i64 t, Views& views) {
    const i64 robots = cells.shape[0], count = patches.room.size();
    const View<f64> by_room = views.room_watched[t], by_patch = views.patch_watched[t], shown = views.shown[t];
    const View<u8> parts = views.shown_parts[t];
    std::fill(by_room.begin(), by_room.end(), 0.0);
    for (i64 p = 0; p < count; ++p) {
        i64 summed = 0, most = 0;
        for (i64 r = 0; r < robots; ++r) {
            summed = std::max(summed, cells(r, 0, p));
            most = std::max(most, cells(r, 1, p));
        }
        const i64 size = std::max(patches.cells[p], i64{1});
        by_patch[p] = static_cast<f64>(summed) / static_cast<f64>(size * bin_steps);
        shown[p] = static_cast<f64>(most) / static_cast<f64>(size);
        parts[p] = static_cast<u8>(std::min(shown[p], 1.0) * PARTS + TO_WHOLE - TO_WHOLE);
    }
    for (i64 r = 0; r < robots; ++r) {
        for (i64 p = 0; p < count;) {
            const i64 room = patches.room[p];
            i64 summed = 0;
            for (; p < count && patches.room[p] == room; ++p) summed += cells(r, 0, p);
            by_room[room] = std::max(by_room[room], static_cast<f64>(summed));
        }
    }
    for (i64 room = 0; room < by_room.size(); ++room) {
        by_room[room] /= static_cast<f64>(patches.room_cells[room] * bin_steps);
    }
}

// Goes along a chain, bin by bin.
class Cursor {
public:
    explicit Cursor(const Chain& chain) : chain_(chain), left_(chain.bins.size() > 0 ? chain.bins[0] : 0) {}

    View<const f64> next() {
        if (left_ == 0) left_ = chain_.bins[++stretch_];
        --left_;
        return chain_.places[stretch_];
    }

private:
    Chain chain_;
    i64 stretch_ = 0;
    i64 left_;  // bins of the stretch
};

// What is known of anyone in the bins of an hour, from the users one by one: (bins, places).
class Anyone {
public:
    Anyone(View<const bool, 2> unknown, i64 begin, i64 end)
        : empty_(Array<f64, 2>::empty({end - begin, unknown.shape[1] + 1})) {
        for (i64 t = begin; t < end; ++t) {
            const View<f64> row = empty_[t - begin];
            bool seen = false;
            for (i64 room = 0; room < unknown.shape[1]; ++room) {
                row[room] = unknown(t, room) ? 0.0 : 1.0;
                seen |= unknown(t, room);
            }
            row[unknown.shape[1]] = seen ? 0.0 : 1.0;
        }
    }

    void take(i64 bin, View<const f64> places) {
        const View<f64> row = empty_[bin];
        const i64 rooms = row.size() - 1;
        for (i64 room = 0; room < rooms; ++room) row[room] *= 1 - std::min(places[room], 1.0);
        row[rooms] *= places[rooms];
    }

    // The probability of each room that somebody is there, and last that nobody is at home.
    View<const f64> places(i64 bin) {
        const View<f64> row = empty_[bin];
        for (i64 room = 0; room + 1 < row.size(); ++room) row[room] = 1 - row[room];
        return row;
    }

private:
    Array<f64, 2> empty_;
};

// What adds up of one bin: values (2 places + 1,).
void set_values(View<const f64> places, View<f64> values) {
    const i64 count = places.size();
    for (i64 place = 0; place < count; ++place) {
        values[place] = places[place];
        values[count + place] = places[place] * (1 - places[place]);
    }
    values[2 * count] = 1;
}

// Sum rows as add.reduceat does: the first one and the sum of the rest.
void reduce(const Array<f64, 2>& values, i64 count, View<f64> sum) {
    const i64 width = sum.size();
    sum_rows(values.data() + width, count - 1, width, sum.data);
    for (i64 k = 0; k < width; ++k) sum[k] = values[0][k] + sum[k];
}

}  // namespace

SightingCounts list_sightings(View<const i64> step, View<const i32> index, View<const i64> user, View<const i64> room,
                              i64 bin_steps, std::array<i64, 3> shape) {
    struct Entry {
        i64 user, bin, room, steps, last;  // the step that was counted last
    };
    std::vector<Entry> entries;
    const auto [bins, users, rooms] = shape;
    auto newest = Array<i64, 2>::filled({users, rooms}, -1);  // entry
    i64 bin = -1, begin = 0;                                  // of the bin
    for (i64 i = 0, next = 0; i < step.size(); i = next) {
        const i64 at = step[i], number = index[i];
        if (bin < 0 || at < begin || at - begin >= bin_steps) {
            bin = floor_div(at, bin_steps);
            if (bin >= bins) bin = -1;
            begin = std::max(bin, i64{0}) * bin_steps;
        }
        // While nobody moves, the same sighting repeats at the next steps of the bin.
        const auto repeats = [&](i64 k) {
            return index[k] == number && step[k] > step[k - 1] && step[k] - begin < bin_steps;
        };
        next = i + 1;
        if (bin < 0 || room[number] < 0) continue;
        while (next < step.size() && repeats(next)) ++next;
        for (const i64 who : {user[number], users - 1}) {
            if (who < 0) continue;
            i64& known = newest(who, room[number]);
            if (known < 0 || entries[static_cast<std::size_t>(known)].bin != bin) {
                known = static_cast<i64>(entries.size());
                entries.push_back({who, bin, room[number], 0, -1});
            }
            Entry& entry = entries[static_cast<std::size_t>(known)];
            entry.steps += next - i - (entry.last == at ? 1 : 0);
            entry.last = step[next - 1];
        }
    }
    std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
        return std::tie(a.user, a.bin, a.room) < std::tie(b.user, b.bin, b.room);
    });
    const std::array<i64, 1> count{static_cast<i64>(entries.size())};
    SightingCounts made{Array<i64>::empty(count), Array<i64>::empty(count), Array<i64>::empty(count),
                        Array<i64>::empty(count)};
    for (i64 i = 0; i < count[0]; ++i) {
        const Entry& entry = entries[static_cast<std::size_t>(i)];
        made.user[i] = entry.user, made.bin[i] = entry.bin, made.room[i] = entry.room, made.steps[i] = entry.steps;
    }
    return made;
}

Views gather_views(View<const i64, 4> cells, const PatchSizes& patches, i64 bin_steps) {
    const i64 bins = cells.shape[0], count = patches.room.size(), rooms = patches.room_cells.size();
    Views views{Array<f64, 2>::empty({bins, rooms}), Array<f64, 2>::empty({bins, count}),
                Array<f64, 2>::empty({bins, count}), Array<u8, 2>::empty({bins, count})};
    const i64 numbers = cells.shape[1] * 2 * count, stride = cells.stride[0];
    for (i64 t = 0; t < bins; ++t) {
        // Robots mostly stand: what they have in view stays the same from bin to bin.
        const View<const i64> row(cells.data + t * stride, {numbers});
        if (t > 0 && same(row, View<const i64>(row.data - stride, {numbers}))) {
            repeat(views.room_watched, t);
            repeat(views.patch_watched, t);
            repeat(views.shown, t);
            repeat(views.shown_parts, t);
        } else {
            share(cells[t], patches, bin_steps, t, views);
        }
    }
    return views;
}

WatchedViews watched_views(View<const u8, 2> shown, const PatchSightings& sightings, i64 users) {
    const i64 bins = shown.size(), patches = shown.shape[1];
    auto unknown = Array<i64, 2>::zeros({users > 1 ? bins : 0, patches});  // steps of anybody, less those of users
    if (users > 1) {
        for (i64 i = 0; i < sightings.user.size(); ++i) {
            const i64 steps = sightings.steps[i];
            unknown(sightings.bin[i], sightings.patch[i]) += sightings.user[i] == users - 1 ? steps : -steps;
        }
    }
    auto view = Array<i64>::empty({bins});
    std::vector<u8> views;
    std::vector<u8> row(static_cast<std::size_t>(patches + 1)), before;
    for (i64 t = 0; t < bins; ++t) {
        for (i64 p = 0; p < patches; ++p) {
            row[static_cast<std::size_t>(p)] = users > 1 && unknown(t, p) > 0 ? u8{0} : shown(t, p);
        }
        if (row != before) {
            views.insert(views.end(), row.begin(), row.end());
            before = row;
        }
        view[t] = static_cast<i64>(views.size()) / (patches + 1) - 1;
    }
    const i64 count = static_cast<i64>(views.size()) / (patches + 1);
    return {std::move(view), Array<u8, 2>::copy_of({views.data(), {count, patches + 1}})};
}

namespace {

void add_places(const std::vector<Chain>& chains, View<const bool, 2> unknown, i64 users, View<const i64> first,
                View<f64, 3> sums) {
    const i64 bins = unknown.size(), width = sums.shape[2];
    std::vector<Cursor> cursors(chains.begin(), chains.end());
    Array<f64, 2> values;
    for (i64 h = 0; h < first.size(); ++h) {
        const i64 begin = first[h], end = h + 1 < first.size() ? first[h + 1] : bins, count = end - begin;
        if (values.size() < count || h == 0) values = Array<f64, 2>::empty({count, width});
        Anyone anyone(unknown, begin, end);
        i64 row = 0;
        for (Cursor& cursor : cursors) {
            for (i64 t = 0; t < count; ++t) {
                const View<const f64> places = cursor.next();
                set_values(places, values[t]);
                if (users > 0) anyone.take(t, places);
            }
            reduce(values, count, sums[h][row++]);
        }
        if (users == 0) continue;
        for (i64 t = 0; t < count; ++t) set_values(anyone.places(t), values[t]);
        reduce(values, count, sums[h][row]);
    }
}

}  // namespace

Array<f64, 3> sum_places(const std::vector<Chain>& chains, View<const bool, 2> unknown, i64 users,
                         View<const i64> first) {
    const i64 width = 2 * (unknown.shape[1] + 1) + 1, rows = users > 0 ? users + 1 : 1;
    auto sums = Array<f64, 3>::empty({first.size(), rows, width});
    side_by_side<1>([&] { add_places(chains, unknown, users, first, sums); });  // several places at once
    return sums;
}

}  // namespace fleet2d
