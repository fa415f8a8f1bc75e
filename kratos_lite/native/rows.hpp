// Numbers in rows, one row after another: row i is entries[start[i] … start[i + 1]).

#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "threads.hpp"

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

    void find(const int64_t* start, int64_t* dealt, int64_t n) {
        for (int64_t row = 0; row < n; ++row) {
            if (row % MANY == 0) look();
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

// Rows of cells, each with the cells around the corners of those in it: ascending, one row after another.
struct Grown {
    std::vector<int64_t> owner, entries;

    // `cells` of each of n rows from `start`; corners (m, c), -1 for none; cells `around` each corner from `from`.
    void grow(const int64_t* start, const int64_t* cells, int64_t n, const int64_t* corners, int64_t m, int64_t c,
              const int64_t* from, const int64_t* around, int64_t nodes) {
        std::vector<int64_t> node_met(nodes, -1), cell_met(m, -1);
        for (int64_t row = 0; row < n; ++row) {
            if (row % 64 == 0) look();
            const size_t first = entries.size();
            for (const int64_t* cell = cells + start[row]; cell < cells + start[row + 1]; ++cell)
                for (int64_t k = 0; k < c; ++k) {
                    const int64_t node = corners[*cell * c + k];
                    if (node < 0 || node_met[node] == row) continue;
                    node_met[node] = row;
                    for (const int64_t* other = around + from[node]; other < around + from[node + 1]; ++other) {
                        if (cell_met[*other] == row) continue;
                        cell_met[*other] = row;
                        entries.push_back(*other);
                    }
                }
            std::sort(entries.begin() + first, entries.end());
            owner.resize(entries.size(), row);
        }
    }
};

}  // namespace kl
