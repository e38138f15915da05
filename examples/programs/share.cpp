// An algorithm in a process of its own, in C++ without any library: the share of sightings of each room.
//
// g++ -std=c++20 -O2 -o share share.cpp
// algorithms: {share: {type: process, command: share, tables: json, period: 1 h}}
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

int main() {
    std::vector<long> counts;
    for (std::string line; std::getline(std::cin, line);) {
        const auto after = [&](const std::string& key) { return line.substr(line.find(key) + key.size()); };
        std::string answer = R"({"type": "ready"})";
        if (line.find(R"("type": "start")") != std::string::npos) {
            std::istringstream rooms(after(R"("rooms": [)"));
            std::getline(rooms, line, ']');
            for (auto at = line.find("{"); at != std::string::npos; at = line.find("{", at + 1)) counts.push_back(0);
        } else if (line.find(R"("type": "update")") != std::string::npos) {
            std::istringstream rooms(after(R"("room": [)"));
            for (long room; rooms >> room; rooms.ignore()) if (room >= 0) ++counts[room];  // to the bracket
            answer.clear();
            for (const long count : counts) answer += (answer.empty() ? "" : ", ") + std::to_string(count);
            answer = R"({"type": "output", "share": [)" + answer + "]}";
        }
        std::cout << answer << std::endl;
    }
}
