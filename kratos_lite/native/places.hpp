// Who adds what to a matrix over a node graph, and where.
//
// Elements are cut into groups, groups into shares of consecutive ones.  A row of the matrix belongs
// to the share with the first element at its node; only the owner of a row adds to it, and it
// computes the groups of later shares that reach into its rows as well.  So every row sums its
// elements in ascending order, whatever the number of shares and of threads.

#pragma once
#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "isa.hpp"
#include "pattern.hpp"
#include "threads.hpp"

namespace kl {

struct Graph {
    int64_t rows;
    const int32_t* indptr;
    const int32_t* indices;
};

class Shares {
public:
    Shares(int64_t rows, const Connectivity& mesh, int width, int threads) : mesh(mesh), width(width) {
        const int64_t groups = (mesh.count + width - 1) / width;
        const int64_t wanted = threads > 1 ? std::min<int64_t>(2 * threads, groups / 8) : 1;
        cut(rows, groups, std::max<int64_t>(1, wanted));
        int64_t computed = 0;
        for (const auto& share : shares) computed += static_cast<int64_t>(share.size());
        if (computed > threads * groups) cut(rows, groups, 1);  // scattered: sharing costs more than it saves
    }

    size_t size() const { return shares.size(); }
    const std::vector<int32_t>& groups(int64_t share) const { return shares[share]; }
    bool owns(int64_t share, int32_t node) const { return owner[node] == share; }

private:
    void cut(int64_t rows, int64_t groups, int64_t count) {
        owner.assign(rows, 0);
        shares.assign(count, {});
        const int64_t each = (groups + count - 1) / count;
        const int64_t nodes = each * width * mesh.k;  // of one share
        for (int64_t s = count - 1; s > 0; --s)       // backwards, so that the first share stays
            for (int64_t i = s * nodes; i < std::min(mesh.count * mesh.k, (s + 1) * nodes); ++i)
                owner[mesh.nodes[i]] = static_cast<int32_t>(s);
        for (int64_t i = 0; i < std::min(mesh.count * mesh.k, nodes); ++i) owner[mesh.nodes[i]] = 0;
        for (int64_t s = 0; s < count; ++s)
            for (int64_t g = s * each; g < std::min(groups, (s + 1) * each); ++g)
                shares[s].push_back(static_cast<int32_t>(g));
        if (count > 1) add_neighbours(groups, each);
    }

    void add_neighbours(int64_t groups, int64_t each) {
        for (int64_t g = 0; g < groups; ++g) {
            const int64_t own = g / each, end = std::min(mesh.count, (g + 1) * width) * mesh.k;
            for (int64_t i = g * width * mesh.k; i < end; ++i) {
                auto& share = shares[owner[mesh.nodes[i]]];
                if (owner[mesh.nodes[i]] != own && share.back() != g)
                    share.push_back(static_cast<int32_t>(g));
            }
        }
    }

    Connectivity mesh;
    int width;
    std::vector<int32_t> owner;
    std::vector<std::vector<int32_t>> shares;
};

// Places of the node pairs of a few elements at a time, found row by row without searching.
class Places {
public:
    Places(const Graph& graph, const Connectivity& mesh, const Shares& shares, int64_t share, int64_t most)
        : graph(graph), mesh(mesh), shares(shares), share(share), first(graph.rows, -1), column(graph.rows),
          next(most * mesh.k), place(most * mesh.k * mesh.k) {}

    // place[(e k + a) k + b] for `count` elements; -1 in rows of others and in elements beyond the last.
    const int32_t* find(const int64_t* elements, int64_t count) {
        touched.clear();
        for (int64_t e = 0, at = 0; e < count; ++e)
            for (int a = 0; a < mesh.k; ++a, ++at) link(elements[e], a, static_cast<int32_t>(at));
        for (const int32_t node : touched) fill(node, elements);
        return place.data();
    }

private:
    void link(int64_t element, int a, int32_t at) {
        const int32_t node = element < mesh.count ? mesh.nodes[element * mesh.k + a] : -1;
        if (node < 0 || !shares.owns(share, node)) {
            std::fill_n(place.begin() + static_cast<int64_t>(at) * mesh.k, mesh.k, -1);
            return;
        }
        if (first[node] < 0) touched.push_back(node);
        next[at] = first[node];
        first[node] = at;
    }

    void fill(int32_t node, const int64_t* elements) {
        const int32_t begin = graph.indptr[node], end = graph.indptr[node + 1];
        for (int32_t p = begin; p < end; ++p) column[graph.indices[p]] = p;
        bool missing = false;
        for (int32_t at = first[node]; at >= 0; at = next[at]) {
            const int32_t* nodes = mesh.nodes + elements[at / mesh.k] * mesh.k;
            int32_t* out = place.data() + static_cast<int64_t>(at) * mesh.k;
            for (int b = 0; b < mesh.k; ++b) {
                out[b] = column[nodes[b]];
                missing |= out[b] < begin || out[b] >= end;
            }
        }
        first[node] = -1;
        if (missing) throw std::invalid_argument("the sparsity pattern misses nodes that share an element");
    }

    Graph graph;
    Connectivity mesh;
    const Shares& shares;
    int64_t share;
    std::vector<int32_t> first, column, next, touched, place;
};

constexpr int64_t BLOCK_PAIRS = 4096;  // node pairs whose places are looked up together

// V elements from `first` on, and the places of their node pairs.
struct Group {
    int64_t first;
    const int32_t* place;  // (V, k, k), -1 where nothing is to be added
    int64_t ahead;         // from there to the places of the next group
    double* work;
};

// f(group) for all elements, V at a time, by all threads; each has `work` numbers of room.
template <class F>
void for_groups(const Connectivity& mesh, const Graph& graph, int V, int64_t work, const F& f) {
    if (!mesh.count) return;
    const Shares shares(graph.rows, mesh, V, wanted_threads());
    const int64_t pairs = static_cast<int64_t>(V) * mesh.k * mesh.k;  // of a group
    const int64_t block = std::max<int64_t>(8, BLOCK_PAIRS / pairs);
    parallel(static_cast<int64_t>(shares.size()), [&](int64_t share) {
        Places places(graph, mesh, shares, share, block * V);
        Space space(work);
        std::vector<int64_t> elements(block * V);
        const auto& groups = shares.groups(share);
        const int64_t total = static_cast<int64_t>(groups.size());
        for (int64_t from = 0; from < total; from += block) {
            const int64_t count = std::min(block, total - from);
            for (int64_t i = 0; i < count * V; ++i)
                elements[i] = static_cast<int64_t>(groups[from + i / V]) * V + i % V;
            const int32_t* place = places.find(elements.data(), count * V);
            for (int64_t i = 0; i < count; ++i, place += pairs)
                f(Group{elements[i * V], place, i + 1 < count ? pairs : 0, space.data()});
        }
    });
}

}  // namespace kl
