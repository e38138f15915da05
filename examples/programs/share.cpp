// An algorithm in a process of its own, in C++ without any library: the share of sightings of each room.
//
// g++ -std=c++20 -O2 -o share share.cpp
// algorithms: {share: {type: process, command: share, sends: [observations], period: 1 h}}
#include <cstdint>
#include <cstring>
#include <iostream>
#include <string>
#include <vector>

// The number after a key of a JSON message, from a position on.
static std::size_t number_after(const std::string& text, const std::string& key, std::size_t from = 0) {
    const std::size_t at = text.find(key, from);
    return at == std::string::npos ? 0 : std::stoul(text.substr(at + key.size()));
}

static std::size_t count(const std::string& text, const std::string& word) {
    std::size_t n = 0;
    for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++n;
    return n;
}

static std::string read_block(std::size_t size) {
    std::string data(size, '\0');
    std::cin.read(data.data(), static_cast<std::streamsize>(size));
    return data;
}

// A little of the format of Arrow IPC streams: tables of FlatBuffers, which hold offsets of their fields.
template <typename T>
static T value_at(const char* place) {
    T value;
    std::memcpy(&value, place, sizeof value);
    return value;
}

// The place of a field of a table; null if the table doesn't have it.
static const char* field(const char* table, int number) {
    const char* offsets = table - value_at<std::int32_t>(table);
    const int at = 4 + 2 * number;
    if (at >= value_at<std::uint16_t>(offsets)) return nullptr;
    const auto offset = value_at<std::uint16_t>(offsets + at);
    return offset == 0 ? nullptr : table + offset;
}

static const char* follow(const char* place) { return place + value_at<std::uint32_t>(place); }

// The values of an integer column, by its number, of a stream whose columns have no missing values.
static std::vector<std::int64_t> column(const std::string& stream, int number) {
    constexpr std::uint8_t RECORD_BATCH = 3;
    std::vector<std::int64_t> values;
    for (std::size_t at = 0; at + 8 <= stream.size();) {
        const auto length = value_at<std::int32_t>(stream.data() + at + 4);
        if (length == 0) break;  // the end of the stream
        const char* message = follow(stream.data() + at + 8);
        const char* body = stream.data() + at + 8 + length;
        const char* body_size = field(message, 3);
        if (value_at<std::uint8_t>(field(message, 1)) == RECORD_BATCH) {
            const char* batch = follow(field(message, 2));
            const char* rows = field(batch, 0);
            const char* buffers = follow(field(batch, 2)) + 4;  // pairs of offset and size: validity, values
            const auto offset = value_at<std::int64_t>(buffers + 16 * (2 * number + 1));
            values.resize(rows == nullptr ? 0 : static_cast<std::size_t>(value_at<std::int64_t>(rows)));
            if (!values.empty()) std::memcpy(values.data(), body + offset, values.size() * sizeof values[0]);
        }
        at = static_cast<std::size_t>(body - stream.data());
        if (body_size != nullptr) at += static_cast<std::size_t>(value_at<std::int64_t>(body_size));
    }
    return values;
}

int main() {
    std::ios::sync_with_stdio(false);
    constexpr int ROOM = 3;  // the columns of observations: step, robot, user, room, x, y, heading
    std::vector<std::int64_t> counts;
    for (std::string line; std::getline(std::cin, line);) {
        std::string answer = R"({"type": "ready"})", data;
        if (line.find(R"("type": "start")") != std::string::npos) {
            const std::string rooms = line.substr(line.find(R"("rooms")"));
            counts.assign(count(rooms.substr(0, rooms.find(']')), R"("name")"), 0);
        } else if (line.find(R"("type": "load")") != std::string::npos) {
            const std::string state = read_block(number_after(line, R"("state", )"));
            std::memcpy(counts.data(), state.data(), state.size());
        } else if (line.find(R"("type": "save")") != std::string::npos) {
            data.assign(reinterpret_cast<const char*>(counts.data()), counts.size() * sizeof counts[0]);
            answer = R"({"type": "state", "blocks": [["state", )" + std::to_string(data.size()) + "]]}";
        } else {
            for (const std::int64_t room : column(read_block(number_after(line, R"("observations", )")), ROOM)) {
                if (room >= 0) ++counts[static_cast<std::size_t>(room)];
            }
            answer = R"({"type": "output", "share": [)";
            for (std::size_t i = 0; i < counts.size(); ++i) answer += (i ? ", " : "") + std::to_string(counts[i]);
            answer += "]}";
        }
        std::cout << answer << '\n' << data << std::flush;
    }
}
