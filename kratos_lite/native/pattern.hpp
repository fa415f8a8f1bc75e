// The sparsity pattern of a mesh: which nodes share an element, in sorted rows (CSR).

#pragma once
#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "threads.hpp"

namespace kl {

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
    std::vector<int32_t> around;
    std::vector<Element> elements;
};

// A set of small numbers that gives them back sorted: one bit each, and one bit for each 64 of them.
class SortedSet {
public:
    explicit SortedSet(int64_t n) : bits(n / 64 + 1), used(n / 4096 + 1) {}

    void add(int32_t i) {
        bits[i >> 6] |= uint64_t{1} << (i & 63);
        used[i >> 12] |= uint64_t{1} << (i >> 6 & 63);
        low = std::min(low, i);
        high = std::max(high, i);
    }

    // Append all numbers in ascending order and forget them.
    void move_to(std::vector<int32_t>& sorted) {
        for (int32_t u = low >> 12; u <= high >> 12; ++u) {
            for (uint64_t words = used[u]; words; words &= words - 1) {
                const int32_t w = u << 6 | __builtin_ctzll(words);
                for (uint64_t word = bits[w]; word; word &= word - 1)
                    sorted.push_back(w << 6 | __builtin_ctzll(word));
                bits[w] = 0;
            }
            used[u] = 0;
        }
        low = INT32_MAX;
        high = -1;
    }

private:
    std::vector<uint64_t> bits, used;
    int32_t low = INT32_MAX, high = -1;
};

// Rows of a pattern: made in pieces by several threads, then copied to where they belong.
class Pattern {
public:
    Pattern(int64_t n, const std::vector<Connectivity>& groups)
        : rows(n), grain(std::max<int64_t>(1024, n / 256)), pieces((n + grain - 1) / grain), length(n) {
        const Incidence mesh(n, groups);
        parallel_ranges(n, grain, [&](int64_t first, int64_t last) {
            SortedSet set(n);
            auto& piece = pieces[first / grain];
            for (int64_t i = first; i < last; ++i) {
                const size_t before = piece.size();
                for (int64_t p = mesh.start[i]; p < mesh.start[i + 1]; ++p) {
                    const Element& element = mesh.elements[mesh.around[p]];
                    for (int b = 0; b < element.k; ++b) set.add(element.nodes[b]);
                }
                if (mesh.start[i] < mesh.start[i + 1]) set.move_to(piece);
                length[i] = static_cast<int32_t>(piece.size() - before);
            }
        });
    }

    int64_t size() const {
        int64_t total = 0;
        for (const auto& piece : pieces) total += static_cast<int64_t>(piece.size());
        return total;
    }

    void copy(int32_t* indptr, int32_t* indices) const {
        indptr[0] = 0;
        for (int64_t i = 0; i < rows; ++i) indptr[i + 1] = indptr[i] + length[i];
        parallel(static_cast<int64_t>(pieces.size()), [&](int64_t i) {
            std::copy(pieces[i].begin(), pieces[i].end(), indices + indptr[i * grain]);
        });
    }

private:
    int64_t rows, grain;
    std::vector<std::vector<int32_t>> pieces;
    std::vector<int32_t> length;
};

}  // namespace kl
