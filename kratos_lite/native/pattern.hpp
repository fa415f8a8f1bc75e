// The sparsity pattern of a mesh: which nodes share an element, in sorted rows (CSR).

#pragma once
#include <algorithm>
#include <cstdint>
#include <numeric>
#include <stdexcept>
#include <utility>
#include <vector>

#include "threads.hpp"

namespace kl {

using Ints = std::vector<int32_t>;

// The pattern of a matrix over nodes: sorted columns of each row (CSR).
struct Graph {
    int64_t rows;
    const int32_t* indptr;
    const int32_t* indices;
};

// Whether all indices are from 0 to n - 1: none is negative, nor is n - 1 less any of them.
inline bool in_range(const int32_t* indices, int64_t count, int64_t n) {
    const int32_t last = static_cast<int32_t>(n - 1);
    int32_t signs = 0;
    for (int64_t i = 0; i < count; ++i) signs |= indices[i] | (last - indices[i]);
    return signs >= 0;
}

// Elements with the same number of nodes: (count, k) rows of nodes.
struct Connectivity {
    const int32_t* nodes;
    int64_t count;
    int k;
};

struct Element {
    const int32_t* nodes;
    int k;
};

// The elements around each node, in rows; made by counting.
class Incidence {
public:
    Incidence(int64_t n, const std::vector<Connectivity>& groups) : start(n + 1) {
        for (const auto& group : groups)
            for (int64_t i = 0; i < group.count * group.k; ++i) {
                if (static_cast<uint32_t>(group.nodes[i]) >= n)
                    throw std::invalid_argument("connectivity names a node that is not there");
                ++start[group.nodes[i]];
            }
        int64_t sum = 0;
        for (int64_t i = 0; i <= n; ++i) start[i] = sum += start[i];  // the ends of the rows, moved down later
        around.resize(sum);
        for (const auto& group : groups)
            for (int64_t e = 0; e < group.count; ++e)
                elements.push_back({group.nodes + e * group.k, group.k});
        for (int64_t e = static_cast<int64_t>(elements.size()) - 1; e >= 0; --e)
            for (int a = 0; a < elements[e].k; ++a)
                around[--start[elements[e].nodes[a]]] = static_cast<int32_t>(e);
    }

    std::vector<int64_t> start;
    Ints around;
    std::vector<Element> elements;
};

// The members of some groups in ascending order, row by row; -1 is no group.
inline void members_of(const Ints& group, int64_t groups, Ints& starts, Ints& members) {
    starts.assign(groups + 1, 0);
    for (int32_t c : group)
        if (c >= 0) ++starts[c + 1];
    std::partial_sum(starts.begin(), starts.end(), starts.begin());
    members.resize(starts[groups]);
    Ints next(starts.begin(), starts.end() - 1);
    for (size_t i = 0; i < group.size(); ++i) {
        if (i % MANY == 0) look();
        if (group[i] >= 0) members[next[group[i]]++] = static_cast<int32_t>(i);
    }
}

// A set of small numbers that gives them back sorted: one bit each, and one bit for each 64 of them.
class SortedSet {
public:
    explicit SortedSet(int64_t n) : bits(n / 64 + 1), used(n / 4096 + 1) {}

    void add(int32_t i) {
        bits[i >> 6] |= uint64_t{1} << (i & 63);
        uint64_t& words = used[i >> 12];
        if (!words) touched.push_back(i >> 12);
        words |= uint64_t{1} << (i >> 6 & 63);
    }

    // Append all numbers in ascending order and forget them.
    void move_to(Ints& sorted) {
        std::sort(touched.begin(), touched.end());
        for (const int32_t u : touched)
            for (uint64_t words = std::exchange(used[u], 0); words; words &= words - 1) {
                const int32_t w = u << 6 | __builtin_ctzll(words);
                for (uint64_t word = std::exchange(bits[w], 0); word; word &= word - 1)
                    sorted.push_back(w << 6 | __builtin_ctzll(word));
            }
        touched.clear();
    }

private:
    std::vector<uint64_t> bits, used;
    Ints touched;
};

// Sorted rows of different numbers, of which lists(i, add) adds those of row i, some of them again: made in pieces
// by several threads, then copied to where they belong.
class UnionRows {
public:
    template <class Lists>
    UnionRows(int64_t rows, int64_t columns, const Lists& lists)
        : rows(rows), grain(std::max<int64_t>(1024, rows / 256 + 1)), pieces((rows + grain - 1) / grain), length(rows) {
        parallel_ranges(rows, grain, [&](int64_t first, int64_t last) {
            SortedSet set(columns);
            auto& piece = pieces[first / grain];
            for (int64_t i = first; i < last; ++i) {
                if (i % 64 == 0) look();
                const size_t before = piece.size();
                lists(i, [&](int32_t number) { set.add(number); });
                set.move_to(piece);
                length[i] = static_cast<int32_t>(piece.size() - before);
            }
        });
    }

    int64_t size() const {
        int64_t total = 0;
        for (const auto& piece : pieces) total += static_cast<int64_t>(piece.size());
        return total;
    }

    void copy_to(int32_t* indptr, int32_t* indices) const {
        indptr[0] = 0;
        for (int64_t i = 0; i < rows; ++i) indptr[i + 1] = indptr[i] + length[i];
        parallel(static_cast<int64_t>(pieces.size()), [&](int64_t i) {
            std::copy(pieces[i].begin(), pieces[i].end(), indices + indptr[i * grain]);
        });
    }

    void copy_to(Ints& indptr, Ints& indices) const {
        indptr.resize(rows + 1);
        indices.resize(size());
        copy_to(indptr.data(), indices.data());
    }

private:
    int64_t rows, grain;
    std::vector<Ints> pieces;
    Ints length;
};

// Which nodes share an element with each of n nodes.
inline UnionRows neighbors(int64_t n, const std::vector<Connectivity>& groups) {
    const Incidence mesh(n, groups);
    return {n, n, [&](int64_t i, const auto& add) {
                for (int64_t p = mesh.start[i]; p < mesh.start[i + 1]; ++p) {
                    const Element& element = mesh.elements[mesh.around[p]];
                    std::for_each(element.nodes, element.nodes + element.k, add);
                }
            }};
}

}  // namespace kl
