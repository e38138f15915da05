#include "evidence.hpp"

#include <cstring>

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

// As NumPy's pairwise sum over fewer than 129 numbers; number i is at data[i * step].
f64 pairwise_sum(const f64* data, i64 count, i64 step) {
    f64 sum = 0;
    i64 i = 0;
    if (count >= 8) {
        f64 part[8];
        for (i64 k = 0; k < 8; ++k) part[k] = data[k * step];
        for (i = 8; i < count - count % 8; i += 8) {
            for (i64 k = 0; k < 8; ++k) part[k] += data[(i + k) * step];
        }
        sum = ((part[0] + part[1]) + (part[2] + part[3])) + ((part[4] + part[5]) + (part[6] + part[7]));
    }
    for (; i < count; ++i) sum += data[i * step];
    return sum;
}

// As NumPy's pairwise sum: halves of more than 128 numbers apart.
f64 whole_sum(const f64* data, i64 count, i64 step) {
    if (count <= 128) return pairwise_sum(data, count, step);
    i64 half = count / 2;
    half -= half % 8;
    return whole_sum(data, half, step) + whole_sum(data + half * step, count - half, step);
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

// Set what adds up of one bin: values (users + 1, 2 places + 1).
void values_of(View<const f64, 3> chains, View<const bool> unknown, i64 users, i64 t, View<f64, 2> values) {
    const i64 places = chains.shape[2], rooms = places - 1;
    for (i64 user = 0; user < chains.shape[0]; ++user) {
        const View<const f64> chain = chains[user][t];
        std::copy(chain.begin(), chain.end(), values[user].begin());
    }
    if (users > 0) {
        const View<f64> anyone = values[users];
        bool seen = false;
        for (i64 room = 0; room < rooms; ++room) {
            f64 empty = unknown[room] ? 0.0 : 1.0;
            seen |= unknown[room];
            for (i64 user = 0; user < users; ++user) empty *= 1 - std::min(chains(user, t, room), 1.0);
            anyone[room] = 1 - empty;
        }
        f64 gone = seen ? 0.0 : 1.0;
        for (i64 user = 0; user < users; ++user) gone *= chains(user, t, rooms);
        anyone[rooms] = gone;
    }
    for (i64 who = 0; who < values.size(); ++who) {
        const View<f64> row = values[who];
        for (i64 place = 0; place < places; ++place) row[places + place] = row[place] * (1 - row[place]);
        row[2 * places] = 1;
    }
}

}  // namespace

Views gather_views(View<const i64, 4> cells, const PatchSizes& patches, i64 bin_steps) {
    const i64 bins = cells.shape[0], count = patches.room.size(), rooms = patches.room_cells.size();
    Views views{Array<f64, 2>::empty({bins, rooms}), Array<f64, 2>::empty({bins, count}),
                Array<f64, 2>::empty({bins, count}), Array<u8, 2>::empty({bins, count})};
    const i64 numbers = cells.shape[1] * 2 * count;
    for (i64 t = 0; t < bins; ++t) {
        // Robots mostly stand: what they have in view stays the same from bin to bin.
        const View<const i64> row(cells.data + t * numbers, {numbers});
        if (t > 0 && same(row, View<const i64>(row.data - numbers, {numbers}))) {
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

Array<f64, 3> sum_places(View<const f64, 3> chains, View<const bool, 2> unknown, i64 users, View<const i64> first) {
    const i64 bins = chains.shape[1], width = 2 * chains.shape[2] + 1, rows = users > 0 ? users + 1 : 1;
    auto sums = Array<f64, 3>::empty({first.size(), rows, width});
    Array<f64, 3> values;
    i64 room = 0;  // bins that `values` has room for
    for (i64 h = 0; h < first.size(); ++h) {
        const i64 begin = first[h], end = h + 1 < first.size() ? first[h + 1] : bins;
        if (end - begin > room) {
            room = end - begin;
            values = Array<f64, 3>::empty({room, rows, width});
        }
        for (i64 t = begin; t < end; ++t) values_of(chains, unknown[t], users, t, values[t - begin]);
        const f64* data = values.data();
        f64* sum = sums.data() + h * rows * width;
        for (i64 k = 0; k < rows * width; ++k) {
            sum[k] = data[k] + whole_sum(data + rows * width + k, end - begin - 1, rows * width);
        }
    }
    return sums;
}

}  // namespace fleet2d
