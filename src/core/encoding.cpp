#include "encoding.hpp"

#include <bit>
#include <cstring>
#include <limits>
#include <vector>

namespace fleet2d {
namespace {

constexpr i64 BLOCK = 64;  // values that are looked at together
constexpr i64 HEADER_BYTES = sizeof(u8) + sizeof(u32) + sizeof(u64);

// Bytes that are written one after the other.
class Writer {
public:
    explicit Writer(u8* next) : next_(next) {}

    u8* next() const { return next_; }

    template <class T>
    void put(T value) {
        std::memcpy(next_, &value, sizeof(T));
        next_ += sizeof(T);
    }

    template <class T>
    void put_all(View<const T> values) {
        if (values.size() == 0) return;
        const auto size = static_cast<std::size_t>(values.size()) * sizeof(T);
        std::memcpy(next_, values.data, size);
        next_ += size;
    }

    void skip(i64 size) { next_ += size; }

    void header(Encoding encoding, i64 count, i64 size) {
        put(static_cast<u8>(encoding));
        put(static_cast<u32>(count));
        put(static_cast<u64>(size));
    }

private:
    u8* next_;
};

// The bytes that a number takes which has all the bits of some numbers.
template <class T>
i64 width_of(T bits) {
    if (bits <= std::numeric_limits<u8>::max()) return 1;
    if (bits <= std::numeric_limits<u16>::max()) return 2;
    if (bits <= std::numeric_limits<u32>::max()) return 4;
    return 8;
}

template <class Narrow, class Number>
void put_numbers(i64 count, Writer& writer, Number number) {
    for (i64 i = 0; i < count; ++i) writer.put(static_cast<Narrow>(number(i)));
}

// Store number(0) to number(count - 1), each in `width` bytes.
template <class Number>
void put_narrow(i64 count, i64 width, Writer& writer, Number number) {
    if (width == 1) put_numbers<u8>(count, writer, number);
    if (width == 2) put_numbers<u16>(count, writer, number);
    if (width == 4) put_numbers<u32>(count, writer, number);
    if (width == 8) put_numbers<u64>(count, writer, number);
}

// Runs of equal values, and how many bytes each length takes.
struct Runs {
    std::vector<i64> begin;
    i64 width = 0;

    i64 count() const { return static_cast<i64>(begin.size()); }
    template <class T>
    i64 bytes() const {
        return count() * (static_cast<i64>(sizeof(T)) + width);
    }
};

// Whether two values have the same bits: of two floating-point numbers, equal isn't enough.
template <class T>
bool is_same(T one, T other) {
    return one == other;
}
bool is_same(f64 one, f64 other) { return std::bit_cast<u64>(one) == std::bit_cast<u64>(other); }

// The runs of equal values; none if they would take `size` bytes or more.
template <class T>
Runs runs_of(View<const T> values, i64 size) {
    const i64 most = (size - 1) / static_cast<i64>(sizeof(T) + 1);
    if (most < 1 || values.size() == 0) return {};
    Runs runs{.begin = {0}};
    i64 longest = 0;
    const auto end_run = [&](i64 end) { longest = std::max(longest, end - runs.begin.back()); };
    for (i64 first = 1; first < values.size(); first += BLOCK) {
        const i64 last = std::min(first + BLOCK, values.size());
        const T* block = values.data + first;  // most have no change, which memcmp tells quickly
        if (std::memcmp(block, block - 1, static_cast<std::size_t>(last - first) * sizeof(T)) == 0) continue;
        for (i64 i = first; i < last; ++i) {
            if (is_same(values[i], values[i - 1])) continue;
            end_run(i);
            runs.begin.push_back(i);
        }
        if (runs.count() > most) return {};
    }
    end_run(values.size());
    runs.width = width_of(static_cast<u64>(longest));
    return runs.bytes<T>() < size ? runs : Runs{};
}

// Store runs if that takes less than `size` bytes.
template <class T>
bool put_runs(View<const T> values, i64 size, Writer& writer) {
    const Runs runs = runs_of(values, size);
    if (runs.count() == 0) return false;
    writer.header(Encoding::RUNS, runs.count(), runs.bytes<T>());
    for (const i64 i : runs.begin) writer.put(values[i]);
    put_narrow(runs.count(), runs.width, writer, [&](i64 run) {
        const auto next = static_cast<std::size_t>(run) + 1;
        return (next < runs.begin.size() ? runs.begin[next] : values.size()) - runs.begin[next - 1];
    });
    return true;
}

template <class T>
void put_raw(View<const T> values, Writer& writer) {
    writer.header(Encoding::RAW, 0, values.size() * static_cast<i64>(sizeof(T)));
    writer.put_all(values);
}

void put_flags(View<const u8> values, Writer& writer) {
    if (!put_runs(values, values.size(), writer)) put_raw(values, writer);
}

void put_floats(View<const f64> values, Writer& writer) {
    if (!put_runs(values, values.size() * 8, writer)) put_raw(values, writer);
}

void put_codes(View<const u32> values, Writer& writer) {
    if (put_runs(values, values.size(), writer)) return;  // nothing is shorter
    u32 bits = 0;
    for (const u32 value : values) bits |= value;
    const i64 width = width_of(bits), size = values.size() * width;
    if (put_runs(values, size, writer)) return;
    if (width == 4 || size == 0) return put_raw(values, writer);
    writer.header(Encoding::NARROW, width, size);
    put_narrow(values.size(), width, writer, [&](i64 i) { return values[i]; });
}

// Store values as a + b times those of the array before them, if they are.
bool put_line(View<const u64> values, View<const u64> previous, Writer& writer) {
    const i64 count = values.size();
    if (count < 3 || previous.size() != count) return false;
    const auto rise = static_cast<i64>(values[count - 1] - values[0]);
    const auto run = static_cast<i64>(previous[count - 1] - previous[0]);
    if (run <= 0 || rise % run != 0) return false;
    // Unsigned numbers wrap around, and so do those of the reader.
    const auto slope = static_cast<u64>(rise / run), start = values[0] - slope * previous[0];
    for (i64 i = 0; i < count; ++i) {
        if (values[i] != start + slope * previous[i]) return false;
    }
    writer.header(Encoding::LINE, 0, 2 * sizeof(u64));
    writer.put(start);
    writer.put(slope);
    return true;
}

constexpr u64 LONG = 255;  // marks a growth that takes more than a byte

// Store by how much each value is above the one before, if that takes less than `size` bytes.
bool put_growth(View<const u64> values, i64 size, Writer& writer) {
    const i64 count = values.size();
    std::vector<u64> longs;
    u8* bytes = writer.next() + HEADER_BYTES + sizeof(u64) - 1;  // of the second value on
    for (i64 first = 1; first < count; first += BLOCK) {
        const i64 last = std::min(first + BLOCK, count);
        u64 bits = 0;
        for (i64 i = first; i < last; ++i) bits |= values[i] - values[i - 1];
        if (bits < LONG) {
            for (i64 i = first; i < last; ++i) bytes[i] = static_cast<u8>(values[i] - values[i - 1]);
            continue;
        }
        for (i64 i = first; i < last; ++i) {
            const u64 growth = values[i] - values[i - 1];
            bytes[i] = static_cast<u8>(std::min(growth, LONG));
            if (growth >= LONG) longs.push_back(growth);
        }
        if (static_cast<i64>(longs.size()) * 8 >= size) return false;
    }
    const i64 taken = 8 + count - 1 + static_cast<i64>(longs.size()) * 8;
    if (count == 0 || taken >= size) return false;
    writer.header(Encoding::GROWTH, 0, taken);
    writer.put(values[0]);
    writer.skip(count - 1);
    for (const u64 growth : longs) writer.put(growth);
    return true;
}

void put_integers(View<const u64> values, View<const u64> previous, Writer& writer) {
    const i64 count = values.size();
    if (put_line(values, previous, writer) || put_runs(values, count, writer)) return;
    if (put_growth(values, 2 * count, writer)) return;
    u64 bits = 0;
    for (const u64 value : values) bits |= value;
    const i64 width = width_of(bits);
    if (put_runs(values, count * width, writer)) return;
    if (width == 8 || count == 0) return put_raw(values, writer);
    writer.header(Encoding::NARROW, width, count * width);
    put_narrow(count, width, writer, [&](i64 i) { return values[i]; });
}

template <class T>
View<const T> as(const Values& values) {
    return {static_cast<const T*>(values.data), {values.size}};
}

i64 bytes_of(Values::Type type) {
    if (type == Values::Type::BOOL || type == Values::Type::TEXT) return 1;
    return type == Values::Type::INT32 ? 4 : 8;
}

}  // namespace

i64 most_bytes(std::span<const Values> arrays) {
    i64 most = 0;
    for (const Values& values : arrays) most += HEADER_BYTES + values.size * bytes_of(values.type);
    return most;
}

i64 encode_arrays(std::span<const Values> arrays, u8* bytes) {
    Writer writer(bytes);
    View<const u64> integers;
    for (const Values& values : arrays) {
        switch (values.type) {
            case Values::Type::BOOL:
                put_flags(as<u8>(values), writer);
                break;
            case Values::Type::TEXT:
                put_raw(as<u8>(values), writer);
                break;
            case Values::Type::INT32:
                put_codes(as<u32>(values), writer);
                break;
            case Values::Type::FLOAT64:
                put_floats(as<f64>(values), writer);
                break;
            case Values::Type::INT64:
                put_integers(as<u64>(values), integers, writer);
                integers = as<u64>(values);
                break;
        }
    }
    return writer.next() - bytes;
}

}  // namespace fleet2d
