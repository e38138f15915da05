// Arrays as bytes for the journal of a run: values that repeat or grow slowly take few bytes.
#pragma once

#include <span>

#include "array.hpp"

namespace fleet2d {

// How the values of an array are stored. The numbers are those in the file.
enum class Encoding : u8 {
    RAW = 0,     // the values
    NARROW = 1,  // whole numbers in fewer bytes
    GROWTH = 2,  // the first value, then by how much each is above the one before: a byte, or 255 and a u64 at the end
    RUNS = 3,    // the value of each run of equal values, then the lengths, each in as many bytes as the longest takes
    LINE = 4,    // a and b: the values are a + b times those of the previous array of 64-bit integers
};

// A one-dimensional array of one of the types that columns have.
struct Values {
    enum class Type { BOOL, TEXT, INT32, INT64, FLOAT64 };

    const void* data = nullptr;
    i64 size = 0;
    Type type = Type::BOOL;
};

// The bytes that `encode_arrays` needs at most.
i64 most_bytes(std::span<const Values> arrays);

// Write arrays one after the other, and return how many bytes they took. Each has a header: the encoding (u8), the
// number of runs or the bytes of a narrow number, if any (u32), and the bytes that follow (u64). All is in the byte
// order of the machine. For 64-bit integers, the first of LINE, RUNS of less than a byte and GROWTH of less than two
// bytes a value is taken that fits; all else is stored as the shortest of RUNS, NARROW and RAW, but text always RAW.
i64 encode_arrays(std::span<const Values> arrays, u8* bytes);

}  // namespace fleet2d
