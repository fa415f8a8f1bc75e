// Numbers in rows, one row after another: row i is entries[start[i] … start[i + 1]).

#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

namespace kl {

// Entries dealt into n rows by their owners, in their order.
inline void deal(const int64_t* owner, const int64_t* entries, int64_t count, int64_t n, int64_t* start,
                 int64_t* dealt) {
    std::fill_n(start, n + 1, int64_t{0});
    for (int64_t i = 0; i < count; ++i) ++start[owner[i]];
    int64_t sum = 0;
    for (int64_t i = 0; i <= n; ++i) start[i] = sum += start[i];  // the ends of the rows, moved down next
    for (int64_t i = count - 1; i >= 0; --i) dealt[--start[owner[i]]] = entries[i];
}

// Distinct entries of each row, ascending, and how often they occur.
struct Distinct {
    std::vector<int64_t> owner, entries, count;

    Distinct(const int64_t* start, int64_t* dealt, int64_t n) {
        for (int64_t row = 0; row < n; ++row) {
            std::sort(dealt + start[row], dealt + start[row + 1]);
            for (int64_t i = start[row]; i < start[row + 1]; ++i) {
                if (i == start[row] || dealt[i] != dealt[i - 1]) {
                    owner.push_back(row);
                    entries.push_back(dealt[i]);
                    count.push_back(0);
                }
                ++count.back();
            }
        }
    }
};

}  // namespace kl
