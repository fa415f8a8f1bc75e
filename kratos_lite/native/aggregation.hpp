// Smoothed aggregation: aggregates of nodes and the prolongator.
//
// Source: Vaněk, Mandel & Brezina, Computing 56 (1996) 179-196.  All results are independent of the
// number of threads: every sum runs in ascending order of rows, whoever computes it.

#pragma once
#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

#include "dense.hpp"
#include "sparse.hpp"

namespace kl {

using Bytes = std::vector<uint8_t>;
using Doubles = std::vector<double>;

// Squared Frobenius norms of blocks.
inline double squared_norm(const double* block, int size) {
    double sum = 0;
    for (int e = 0; e < size; ++e) sum += block[e] * block[e];
    return sum;
}

inline Doubles diagonal_norms(const Graph& g, const double* A, int size) {
    Doubles norms(g.rows, 0.0);
    for (int64_t i = 0; i < g.rows; ++i)
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k)
            if (g.indices[k] == i) norms[i] = std::sqrt(squared_norm(A + int64_t{k} * size, size));
    return norms;
}

// Links within the rows that are not weaker than theta sqrt(|A_ii| |A_jj|); none for all of them.
inline Bytes strong_links(const Graph& g, const double* A, int size, double theta) {
    if (theta == 0) return {};
    const Doubles own = diagonal_norms(g, A, size);
    Bytes strong(g.indptr[g.rows]);
    parallel_ranges(g.rows, ROW_GRAIN, [&](int64_t first, int64_t last) {
        for (int64_t i = first; i < last; ++i)
            for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k) {
                const int32_t j = g.indices[k];
                const double norm = std::sqrt(squared_norm(A + int64_t{k} * size, size));
                strong[k] = j == i || (j < g.rows && norm >= theta * std::sqrt(own[i] * own[j]));
            }
    });
    return strong;
}

// Number the aggregate of each node, -1 for nodes that `excluded` leaves out; returns how many there are.
// Weak links, as between materials of a large stiffness contrast, do not join nodes.
inline int32_t aggregate(const Graph& g, const Bytes& excluded, const Bytes& strong, Ints& of) {
    of.assign(g.rows, -1);
    Ints joined(g.rows, -1);
    int32_t count = 0;
    const auto linked = [&](int32_t k) { return !excluded[g.indices[k]] && (strong.empty() || strong[k]); };
    const auto is_free = [&](int64_t i) { return !excluded[i] && of[i] < 0; };
    for (int64_t i = 0; i < g.rows; ++i) {  // nodes whose neighbors are all free make an aggregate
        if (i % MANY == 0) look();
        bool untouched = is_free(i);
        for (int32_t k = g.indptr[i]; untouched && k < g.indptr[i + 1]; ++k)
            untouched = !linked(k) || of[g.indices[k]] < 0;
        if (!untouched) continue;
        of[i] = count;
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k)
            if (linked(k)) of[g.indices[k]] = count;
        ++count;
    }
    for (int64_t i = 0; i < g.rows; ++i)  // the others join a neighbor's aggregate
        for (int32_t k = g.indptr[i]; is_free(i) && joined[i] < 0 && k < g.indptr[i + 1]; ++k)
            if (linked(k)) joined[i] = of[g.indices[k]];
    for (int64_t i = 0; i < g.rows; ++i) {  // what is left makes aggregates of its own
        if (!is_free(i)) continue;
        of[i] = joined[i] >= 0 ? joined[i] : count;
        if (joined[i] >= 0) continue;
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k)
            if (linked(k) && of[g.indices[k]] < 0 && joined[g.indices[k]] < 0) of[g.indices[k]] = count;
        ++count;
    }
    return count;
}

// The vectors q (modes, m) made orthonormal by Gram-Schmidt, twice; r (modes, modes) takes the triangular
// factor.  A vector that cannot be told from those before it becomes zero.
inline void orthonormalize(double* Q, int64_t m, double* r, int modes) {
    for (int c = 0; c < modes; ++c) {
        double* q = Q + c * m;
        double before = 0, after = 0;
        for (int64_t k = 0; k < m; ++k) before += q[k] * q[k];
        for (int pass = 0; pass < 2; ++pass)
            for (int p = 0; p < c; ++p) {
                double dot = 0;
                for (int64_t k = 0; k < m; ++k) dot += Q[p * m + k] * q[k];
                for (int64_t k = 0; k < m; ++k) q[k] -= dot * Q[p * m + k];
                r[p * modes + c] += dot;
            }
        for (int64_t k = 0; k < m; ++k) after += q[k] * q[k];
        const bool lost = !(after > 1e-16 * before);
        const double norm = lost ? 0 : std::sqrt(after);
        r[c * modes + c] = norm;
        for (int64_t k = 0; k < m; ++k) q[k] = lost ? 0 : q[k] / norm;
    }
}

// The tentative prolongator: rows of B (n, b, 6 sets) orthonormalized over each aggregate.  B becomes T
// (n, sets, b, 6); returns R (count, sets, 6, 6 sets), which is B of the coarse nodes: `sets` of them for
// each aggregate.  A mode that an aggregate cannot tell from the modes before it (few nodes, fixed
// components) becomes zero.
inline Doubles tentative_prolongator(int b, const Ints& of, int32_t count, Doubles& B, int sets) {
    const int modes = MODES * sets;
    Doubles R(static_cast<size_t>(count) * modes * modes, 0.0), T(sets > 1 ? B.size() : 0, 0.0);
    Doubles& to = sets > 1 ? T : B;
    Ints members, starts;
    members_of(of, count, starts, members);
    parallel_ranges(count, 64, [&](int64_t first, int64_t last) {
        Doubles Q;
        for (int64_t a = first; a < last; ++a) {
            const int64_t m = static_cast<int64_t>(starts[a + 1] - starts[a]) * b;
            Q.resize(m * modes);
            const auto each = [&](const auto& f) {  // number of Q, row and mode
                for (int64_t k = 0; k < m; ++k) {
                    const int64_t node = members[starts[a] + k / b], r = k % b;
                    for (int c = 0; c < modes; ++c) f(Q[c * m + k], node, r, c);
                }
            };
            each([&](double& q, int64_t node, int64_t r, int c) { q = B[(node * b + r) * modes + c]; });
            orthonormalize(Q.data(), m, &R[a * modes * modes], modes);
            each([&](double& q, int64_t node, int64_t r, int c) {
                to[((node * sets + c / MODES) * b + r) * MODES + c % MODES] = q;
            });
        }
    });
    if (sets > 1) B.swap(T);
    return R;
}

// A prolongator of b x 6 blocks, in single precision: its rounding changes energies by its square only.
struct Prolongator {
    Ints indptr, indices;
    std::vector<float> data;  // and eight numbers more, as vectors read beyond the end
};

// What the smoothing of a prolongator needs: the matrix, the aggregates and the tentative prolongator.
struct Smoothing {
    int b;
    Graph g;
    const double* A;
    const Bytes& fixed;
    const Ints& of;
    const Doubles& T;
    int sets;  // coarse nodes of each aggregate
    double omega;

    int64_t coarse_nodes() const { return g.rows * sets; }  // at most

    // Add the coarse nodes of the aggregates that node i is linked to: the columns of its row of P.
    template <class Add>
    void add_columns(int64_t i, const Add& add) const {
        for (int32_t k = g.indptr[i]; of[i] >= 0 && k < g.indptr[i + 1]; ++k)
            for (int32_t e = 0, a = of[g.indices[k]]; a >= 0 && e < sets; ++e) add(a * sets + e);
    }

    // P = T - omega smoothed of one block in row i and a column, a coarse node.
    KL_INLINE void store(int64_t i, int32_t column, const double* smoothed, float* P) const {
        const bool own = column / sets == of[i];
        for (int e = 0; e < b * MODES; ++e) {
            const double tentative = own ? T[(i * sets + column % sets) * b * MODES + e] : 0.0;
            P[e] = fixed[i * b + e / MODES] ? 0.0f : static_cast<float>(tentative - omega * smoothed[e]);
        }
    }
};

// P = T - omega D^-1 A T for some rows.
template <int b>
KL_INLINE void smooth_rows(const Smoothing& s, const double* Dinv, Prolongator& P, int64_t first, int64_t last) {
    constexpr int size = b * MODES;
    Doubles row;
    for (int64_t i = first; i < last; ++i) {
        const int32_t start = P.indptr[i], count = P.indptr[i + 1] - start;
        if (!count) continue;
        const int32_t* columns = &P.indices[start];
        row.assign(count * size, 0.0);
        for (int32_t k = s.g.indptr[i]; k < s.g.indptr[i + 1]; ++k) {
            const int32_t j = s.g.indices[k], aggregate = s.of[j];
            if (aggregate < 0) continue;
            const int64_t at = std::lower_bound(columns, columns + count, aggregate * s.sets) - columns;
            for (int e = 0; e < s.sets; ++e)
                add_product<b, b>(&row[(at + e) * size], s.A + static_cast<int64_t>(k) * b * b,
                                  &s.T[(static_cast<int64_t>(j) * s.sets + e) * size]);
        }
        for (int32_t c = 0; c < count; ++c) {
            double smoothed[size] = {};
            add_product<b, b>(smoothed, Dinv + i * b * b, &row[c * size]);
            s.store(i, columns[c], smoothed, &P.data[static_cast<int64_t>(start + c) * size]);
        }
    }
}

inline Prolongator smoothed_prolongator(const Smoothing& s, const double* Dinv) {
    const Graph& g = s.g;
    Prolongator P;
    UnionRows(g.rows, s.coarse_nodes(), [&](int64_t i, const auto& add) {
        s.add_columns(i, add);
    }).copy_to(P.indptr, P.indices);
    P.data.resize(P.indices.size() * s.b * MODES + 8);  // vectors read beyond the end
    parallel_ranges(g.rows, ROW_GRAIN, [&](int64_t first, int64_t last) {
        with_size(s.b, [&](auto b) {
            dispatch<double>([&](auto) KL_INLINE_LAMBDA { smooth_rows<decltype(b)::value>(s, Dinv, P, first, last); });
        });
    });
    return P;
}

}  // namespace kl
