// Overlapping parts of a level: aggregates with the nodes around them.  Where a plate is thin beside its
// cells, fields without shear span several cells, so that only a smoother which solves such parts exactly
// changes them.
//
// Source of smoothing by overlapping parts for shear: Schöberl & Stenberg, SIAM J. Numer. Anal. 47 (2009)
// 1997-2017.  Aggregates as their cores are our own.

#pragma once
#include "clusters.hpp"
#include "galerkin.hpp"

namespace kl {

constexpr double LARGEST_PATCHES = 6;  // blocks of all factors to those of the matrix

class Patches {
public:
    Patches() = default;

    // Parts of A, of b x b blocks; `of` numbers the aggregate of each node, -1 for none.  There are none
    // if they would take too much memory.
    Patches(const Graph& g, const double* A, int b, const Bytes& fixed, const Ints& of, int32_t count) {
        Ints rows, nodes;
        with_neighbors(g, of, count, rows, nodes);
        const int64_t copies = static_cast<int64_t>(nodes.size());
        Ints indptr(copies + 1, 0), indices, links, label(copies), place(g.rows, -1);
        for (int32_t a = 0; a < count; ++a) {
            if (a % 64 == 0) watch().look();
            for (int32_t s = rows[a]; s < rows[a + 1]; ++s) place[nodes[s]] = s;
            for (int32_t s = rows[a]; s < rows[a + 1]; ++s) {
                label[s] = rows[a];
                for (int32_t k = g.indptr[nodes[s]]; k < g.indptr[nodes[s] + 1]; ++k) {
                    if (place[g.indices[k]] < 0) continue;
                    indices.push_back(place[g.indices[k]]);
                    links.push_back(k);
                }
                indptr[s + 1] = static_cast<int32_t>(indices.size());
            }
            for (int32_t s = rows[a]; s < rows[a + 1]; ++s) place[nodes[s]] = -1;
        }
        const Graph expanded{copies, indptr.data(), indices.data()};
        parts.collect(expanded, label);
        int64_t envelope = 0;
        Ints position(copies);
        for (int64_t c = 0; c < parts.count(); ++c) envelope += parts.envelope(expanded, c, position);
        if (envelope > LARGEST_PATCHES * g.indptr[g.rows]) return;
        Bytes held(copies * b);
        for (int64_t s = 0; s < copies; ++s) std::copy_n(&fixed[int64_t{nodes[s]} * b], b, &held[s * b]);
        parts.factorize(expanded, A, b, held, links.data());
        parts.exact = {};
        node.resize(copies);
        for (int64_t p = 0; p < copies; ++p) node[p] = nodes[parts.members[p]];
        members_of(node, g.rows, starts, places);
        z.assign(copies * b, 0.0f);
    }

    bool empty() const { return starts.empty(); }
    int64_t bytes() const {
        return parts.bytes() + 4 * static_cast<int64_t>(node.size() + starts.size() + places.size() + z.size());
    }

    // d = alpha d + beta S r and x = from + d, or from zero, where S sums the solutions of all parts; x may be r.
    void step(int b, const float* r, const float* from, float* d, float* x, float alpha, float beta) const {
        parts.over(512, [&](int64_t first, int64_t last) {
            const int64_t start = int64_t{parts.starts[first]} * b, end = int64_t{parts.starts[last]} * b;
            for (int64_t p = parts.starts[first]; p < parts.starts[last]; ++p)
                std::copy_n(r + int64_t{node[p]} * b, b, &z[p * b]);
            dispatch<float>(
                [&](auto V) KL_INLINE_LAMBDA { substitute_rows<V>(parts.factor, start, end, &z[start]); });
        });
        parallel_ranges(static_cast<int64_t>(starts.size()) - 1, 512, [&](int64_t first, int64_t last) {
            for (int64_t i = first; i < last; ++i)
                for (int c = 0; c < b; ++c) {
                    float sum = 0;
                    for (int32_t k = starts[i]; k < starts[i + 1]; ++k) sum += z[int64_t{places[k]} * b + c];
                    d[i * b + c] = (from ? alpha * d[i * b + c] : 0) + beta * sum;
                    x[i * b + c] = (from ? from[i * b + c] : 0) + d[i * b + c];
                }
        });
    }

private:
    // The nodes of each aggregate and their neighbors.
    static void with_neighbors(const Graph& g, const Ints& of, int32_t count, Ints& rows, Ints& nodes) {
        Ints starts, members;
        members_of(of, count, starts, members);
        union_pattern(
            count, g.rows,
            [&](int64_t a, const auto& add) {
                for (int32_t p = starts[a]; p < starts[a + 1]; ++p)
                    add(g.indices + g.indptr[members[p]], g.indices + g.indptr[members[p] + 1]);
            },
            rows, nodes);
    }

    Clusters parts;       // of copies of nodes
    Ints node;            // of each copy, in the order of the factor
    Ints starts, places;  // copies of each node
    mutable Floats z;
};

}  // namespace kl
