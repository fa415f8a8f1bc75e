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

constexpr double LARGEST_PATCHES = 6;     // blocks of all factors to those of the matrix
constexpr int32_t SAMPLES = 8;            // parts that show whether lines smooth well
constexpr double LEAST_OF_LINES = 0.005;  // eigenvalue there from which on they do

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
            if (a % 64 == 0) look();
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

    bool holds(int64_t i) const { return starts[i + 1] > starts[i]; }

private:
    // The nodes of each aggregate and their neighbors.
    static void with_neighbors(const Graph& g, const Ints& of, int32_t count, Ints& rows, Ints& nodes) {
        Ints starts, members;
        members_of(of, count, starts, members);
        UnionRows(count, g.rows, [&](int64_t a, const auto& add) {
            for (int32_t p = starts[a]; p < starts[a + 1]; ++p)
                std::for_each(g.indices + g.indptr[members[p]], g.indices + g.indptr[members[p] + 1], add);
        }).copy_to(rows, nodes);
    }

    Clusters parts;       // of copies of nodes
    Ints node;            // of each copy, in the order of the factor
    Ints starts, places;  // copies of each node
    mutable Floats z;
};

// y = D x in some parts, where D are the blocks of A within lines, without fixed components.
inline void multiply_lines(const Graph& g, const double* A, int b, const Bytes& fixed, const Clusters& lines,
                           const Patches& parts, const Floats& x, Floats& y) {
    parallel_ranges(g.rows, 512, [&](int64_t first, int64_t last) {
        for (int64_t i = first; i < last; ++i) {
            std::fill_n(&y[i * b], b, 0.0f);
            for (int32_t k = g.indptr[i]; parts.holds(i) && k < g.indptr[i + 1]; ++k) {
                const int64_t j = g.indices[k];
                if (lines.of[j] != lines.of[i]) continue;
                for (int e = 0; e < b * b; ++e) {
                    const int64_t row = i * b + e / b, column = j * b + e % b;
                    if (!fixed[row] && !fixed[column])
                        y[row] += static_cast<float>(A[int64_t{k} * b * b + e] * x[column]);
                }
            }
        }
    });
}

// About the smallest eigenvalue of D^-1 A on a few aggregates with their neighbors, where D are the blocks of
// lines: what smoothing of lines leaves there.  By inverse iteration.
inline double least_of_lines(const Graph& g, const double* A, int b, const Bytes& fixed, const Clusters& lines,
                             const Ints& of, int32_t count) {
    Ints some(of.size(), -1);
    const int32_t each = std::max(1, count / SAMPLES), samples = std::min(SAMPLES, count / each);
    for (size_t i = 0; i < of.size(); ++i)
        if (of[i] >= 0 && of[i] % each == each / 2 && of[i] / each < samples) some[i] = of[i] / each;
    const Patches parts(g, A, b, fixed, some, samples);
    if (parts.empty()) return 1;
    const int64_t size = g.rows * b;
    Floats u(size + 8), v(size + 8), d(size + 8);
    for (int64_t i = 0; i < size; ++i) v[i] = static_cast<float>(i * 7919 % 101) / 50 - 1;
    double least = 1;
    for (int pass = 0; pass < 8; ++pass) {
        const double before = dot(u.data(), v.data(), size);  // of v = A^-1 u: its energy
        multiply_lines(g, A, b, fixed, lines, parts, v, u);
        const double norm = dot(u.data(), v.data(), size);
        if (!(norm > 0)) break;
        if (pass) least = before / norm;
        const float scale = static_cast<float>(1 / std::sqrt(norm));
        for_each(size, [&](int64_t i) { u[i] *= scale; });
        parts.step(b, u.data(), nullptr, d.data(), v.data(), 0, 1);
    }
    return least;
}

}  // namespace kl
