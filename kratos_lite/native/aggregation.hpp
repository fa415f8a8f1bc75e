// Smoothed aggregation: aggregates of nodes, the prolongator and the Galerkin product.
//
// Source: Vaněk, Mandel & Brezina, Computing 56 (1996) 179-196.  All results are independent of the
// number of threads: every sum runs in ascending order of rows, whoever computes it.

#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "dense.hpp"
#include "sparse.hpp"

namespace kl {

using Ints = std::vector<int32_t>;
constexpr int MODES = 6;  // near-nullspace vectors, and unknowns of a coarse node

struct Graph {
    int64_t rows;
    const int32_t* indptr;
    const int32_t* indices;
};

// Number the aggregate of each node, -1 for nodes that `apart` excludes; returns how many there are.
// Weak links, as between materials of very unlike stiffness, do not join nodes.
inline int32_t aggregate(const Graph& g, const std::vector<uint8_t>& apart,
                         const std::vector<uint8_t>& strong, Ints& of) {
    of.assign(g.rows, -1);
    Ints joined(g.rows, -1);
    int32_t count = 0;
    const auto linked = [&](int32_t k) { return !apart[g.indices[k]] && (strong.empty() || strong[k]); };
    for (int64_t i = 0; i < g.rows; ++i) {  // nodes whose neighbours are all free make an aggregate
        if (apart[i] || of[i] >= 0) continue;
        bool untouched = true;
        for (int32_t k = g.indptr[i]; untouched && k < g.indptr[i + 1]; ++k)
            untouched = !linked(k) || of[g.indices[k]] < 0;
        if (!untouched) continue;
        of[i] = count;
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k)
            if (linked(k)) of[g.indices[k]] = count;
        ++count;
    }
    for (int64_t i = 0; i < g.rows; ++i) {  // the others join a neighbour's aggregate
        if (apart[i] || of[i] >= 0) continue;
        for (int32_t k = g.indptr[i]; joined[i] < 0 && k < g.indptr[i + 1]; ++k)
            if (linked(k)) joined[i] = of[g.indices[k]];
    }
    for (int64_t i = 0; i < g.rows; ++i) {  // what is left makes aggregates of its own
        if (apart[i] || of[i] >= 0) continue;
        if (joined[i] >= 0) {
            of[i] = joined[i];
            continue;
        }
        of[i] = count;
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k)
            if (linked(k) && of[g.indices[k]] < 0 && joined[g.indices[k]] < 0) of[g.indices[k]] = count;
        ++count;
    }
    return count;
}

// Entries of each column, in ascending rows.
struct Transposed {
    Ints indptr, rows, places;
    Transposed() = default;
    Transposed(int64_t n, const Ints& row_pointer, const Ints& columns) : indptr(n + 1, 0) {
        for (int32_t c : columns) ++indptr[c + 1];
        for (int64_t c = 0; c < n; ++c) indptr[c + 1] += indptr[c];
        rows.resize(columns.size());
        places.resize(columns.size());
        Ints next(indptr.begin(), indptr.end() - 1);
        for (size_t i = 0; i + 1 < row_pointer.size(); ++i)
            for (int32_t k = row_pointer[i]; k < row_pointer[i + 1]; ++k) {
                const int32_t at = next[columns[k]]++;
                rows[at] = static_cast<int32_t>(i);
                places[at] = k;
            }
    }
};

// The tentative prolongator: rows of B orthonormalised over each aggregate.  B (n, b, 6) becomes T in
// place, R (count, 6, 6) is B of the coarse nodes.  A mode that an aggregate cannot tell from the
// modes before it (few nodes, fixed components) becomes zero.
template <int b>
void orthonormalise(const Ints& of, int32_t count, std::vector<double>& B, std::vector<double>& R) {
    R.assign(static_cast<size_t>(count) * MODES * MODES, 0.0);
    Ints members, starts(count + 1, 0);
    for (int32_t a : of)
        if (a >= 0) ++starts[a + 1];
    for (int32_t a = 0; a < count; ++a) starts[a + 1] += starts[a];
    members.resize(starts[count]);
    Ints next(starts.begin(), starts.end() - 1);
    for (size_t i = 0; i < of.size(); ++i)
        if (of[i] >= 0) members[next[of[i]]++] = static_cast<int32_t>(i);
    parallel_ranges(count, 64, [&](int64_t first, int64_t last) {
        std::vector<double> Q;
        for (int64_t a = first; a < last; ++a) {
            const int64_t m = static_cast<int64_t>(starts[a + 1] - starts[a]) * b;
            Q.resize(m * MODES);
            double* r = &R[a * MODES * MODES];
            for (int64_t k = 0; k < m; ++k) {
                const double* row = &B[(static_cast<int64_t>(members[starts[a] + k / b]) * b + k % b) * MODES];
                for (int c = 0; c < MODES; ++c) Q[c * m + k] = row[c];
            }
            for (int c = 0; c < MODES; ++c) {
                double* q = &Q[c * m];
                double before = 0, after = 0;
                for (int64_t k = 0; k < m; ++k) before += q[k] * q[k];
                for (int pass = 0; pass < 2; ++pass)
                    for (int p = 0; p < c; ++p) {
                        double dot = 0;
                        for (int64_t k = 0; k < m; ++k) dot += Q[p * m + k] * q[k];
                        for (int64_t k = 0; k < m; ++k) q[k] -= dot * Q[p * m + k];
                        r[p * MODES + c] += dot;
                    }
                for (int64_t k = 0; k < m; ++k) after += q[k] * q[k];
                const bool lost = !(after > 1e-16 * before);
                const double norm = lost ? 0 : std::sqrt(after);
                r[c * MODES + c] = norm;
                for (int64_t k = 0; k < m; ++k) q[k] = lost ? 0 : q[k] / norm;
            }
            for (int64_t k = 0; k < m; ++k) {
                double* row = &B[(static_cast<int64_t>(members[starts[a] + k / b]) * b + k % b) * MODES];
                for (int c = 0; c < MODES; ++c) row[c] = Q[c * m + k];
            }
        }
    });
}

// A prolongator of b x 6 blocks.
struct Prolongator {
    Ints indptr, indices;
    std::vector<double> data;
};

template <int b>
struct SmoothRows {
    Graph g;
    const double* A;
    const double* Dinv;
    const std::vector<uint8_t>& fixed;
    const Ints& of;
    const std::vector<double>& T;
    double omega;
    Prolongator& P;
    int64_t first, last;
};

// P = T - omega D^-1 A T for some rows.
template <int b>
KL_INLINE void smooth_rows(const SmoothRows<b>& s) {
    constexpr int size = b * MODES;
    for (int64_t i = s.first; i < s.last; ++i) {
        const int32_t start = s.P.indptr[i], count = s.P.indptr[i + 1] - start;
        if (!count) continue;
        const int32_t* columns = &s.P.indices[start];
        double* row = &s.P.data[static_cast<int64_t>(start) * size];
        for (int32_t k = s.g.indptr[i]; k < s.g.indptr[i + 1]; ++k) {
            const int32_t j = s.g.indices[k], aggregate = s.of[j];
            if (aggregate < 0) continue;
            const int32_t at = static_cast<int32_t>(std::lower_bound(columns, columns + count, aggregate) - columns);
            add_product<b, b>(row + at * size, s.A + static_cast<int64_t>(k) * b * b,
                              &s.T[static_cast<int64_t>(j) * size]);
        }
        for (int32_t c = 0; c < count; ++c) {
            double smoothed[size] = {};
            add_product<b, b>(smoothed, s.Dinv + i * b * b, row + c * size);
            const bool own = columns[c] == s.of[i];
            for (int e = 0; e < size; ++e) {
                const double tentative = own ? s.T[i * size + e] : 0.0;
                row[c * size + e] = s.fixed[i * b + e / MODES] ? 0.0 : tentative - s.omega * smoothed[e];
            }
        }
    }
}

template <int V>
KL_INLINE void smooth_rows_3(const SmoothRows<3>& s) { smooth_rows<3>(s); }
template <int V>
KL_INLINE void smooth_rows_6(const SmoothRows<6>& s) { smooth_rows<6>(s); }
KL_DISPATCH(smooth_some, smooth_rows_3, double, const SmoothRows<3>&)
KL_DISPATCH(smooth_some, smooth_rows_6, double, const SmoothRows<6>&)

template <int b>
Prolongator smoothed_prolongator(const Graph& g, const double* A, const double* Dinv,
                                 const std::vector<uint8_t>& fixed, const Ints& of, const std::vector<double>& T, double omega) {
    Prolongator P;
    P.indptr.assign(g.rows + 1, 0);
    const auto columns_of = [&](int64_t i, Ints& found) {
        found.clear();
        if (of[i] >= 0) found.push_back(of[i]);
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k) {
            const int32_t a = of[g.indices[k]];
            if (a >= 0) found.push_back(a);
        }
        std::sort(found.begin(), found.end());
        found.erase(std::unique(found.begin(), found.end()), found.end());
    };
    parallel_ranges(g.rows, ROW_GRAIN, [&](int64_t first, int64_t last) {
        Ints found;
        for (int64_t i = first; i < last; ++i) {
            columns_of(i, found);
            P.indptr[i + 1] = static_cast<int32_t>(of[i] < 0 ? 0 : found.size());
        }
    });
    for (int64_t i = 0; i < g.rows; ++i) P.indptr[i + 1] += P.indptr[i];
    P.indices.resize(P.indptr[g.rows]);
    P.data.assign(static_cast<size_t>(P.indptr[g.rows]) * b * MODES, 0.0);
    parallel_ranges(g.rows, ROW_GRAIN, [&](int64_t first, int64_t last) {
        Ints found;
        for (int64_t i = first; i < last; ++i) {
            if (of[i] < 0) continue;
            columns_of(i, found);
            std::copy(found.begin(), found.end(), P.indices.begin() + P.indptr[i]);
        }
        smooth_some(SmoothRows<b>{g, A, Dinv, fixed, of, T, omega, P, first, last});
    });
    return P;
}

// A matrix of 6x6 blocks in rows.
struct CoarseMatrix {
    Ints indptr, indices;
    std::vector<double> data;
};

template <int b>
struct Galerkin {
    Graph g;
    const double* A;
    const Prolongator& P;
    const Ints& product_pointer;  // pattern of A P
    const Ints& product_columns;
    CoarseMatrix& C;
    int64_t first, last;  // coarse rows
};

// Coarse rows [first, last) of P^T A P.  Fine rows come in ascending order; A P exists for one row.
template <int b>
KL_INLINE void galerkin_rows(const Galerkin<b>& s) {
    constexpr int size = b * MODES;
    std::vector<double> product;
    for (int64_t i = 0; i < s.g.rows; ++i) {
        const int32_t p0 = s.P.indptr[i], p1 = s.P.indptr[i + 1];
        if (p0 == p1 || s.P.indices[p1 - 1] < s.first || s.P.indices[p0] >= s.last) continue;
        const int32_t start = s.product_pointer[i], count = s.product_pointer[i + 1] - start;
        const int32_t* columns = &s.product_columns[start];
        product.assign(static_cast<size_t>(count) * size, 0.0);
        for (int32_t k = s.g.indptr[i]; k < s.g.indptr[i + 1]; ++k) {
            const int32_t j = s.g.indices[k];
            const int32_t* at = columns;
            for (int32_t q = s.P.indptr[j]; q < s.P.indptr[j + 1]; ++q) {
                while (*at < s.P.indices[q]) ++at;
                add_product<b, b>(&product[(at - columns) * size], s.A + static_cast<int64_t>(k) * b * b,
                                         &s.P.data[static_cast<int64_t>(q) * size]);
            }
        }
        for (int32_t p = p0; p < p1; ++p) {
            const int32_t I = s.P.indices[p];
            if (I < s.first || I >= s.last) continue;
            const int32_t* at = &s.C.indices[s.C.indptr[I]];
            for (int32_t c = 0; c < count; ++c) {
                while (*at < columns[c]) ++at;
                add_transposed_product<MODES, b>(
                    &s.C.data[(at - s.C.indices.data()) * MODES * MODES],
                    &s.P.data[static_cast<int64_t>(p) * size], &product[c * size]);
            }
        }
    }
}

template <int V>
KL_INLINE void galerkin_rows_3(const Galerkin<3>& s) { galerkin_rows<3>(s); }
template <int V>
KL_INLINE void galerkin_rows_6(const Galerkin<6>& s) { galerkin_rows<6>(s); }
KL_DISPATCH(galerkin_some, galerkin_rows_3, double, const Galerkin<3>&)
KL_DISPATCH(galerkin_some, galerkin_rows_6, double, const Galerkin<6>&)

// Rows of the pattern of a product, each the sorted union of some lists of columns.
template <class Lists>
void union_pattern(int64_t rows, int64_t columns, const Lists& lists, Ints& indptr, Ints& indices) {
    indptr.assign(rows + 1, 0);
    const int64_t tasks = (rows + 4 * ROW_GRAIN - 1) / (4 * ROW_GRAIN);
    std::vector<Ints> found(tasks);
    parallel(tasks, [&](int64_t task) {
        Ints seen(columns, -1);
        Ints& mine = found[task];
        const int64_t first = task * 4 * ROW_GRAIN, last = std::min(rows, first + 4 * ROW_GRAIN);
        for (int64_t i = first; i < last; ++i) {
            const size_t start = mine.size();
            lists(i, [&](const int32_t* from, const int32_t* to) {
                for (; from != to; ++from)
                    if (seen[*from] != i) {
                        seen[*from] = static_cast<int32_t>(i);
                        mine.push_back(*from);
                    }
            });
            std::sort(mine.begin() + start, mine.end());
            indptr[i + 1] = static_cast<int32_t>(mine.size() - start);
        }
    });
    for (int64_t i = 0; i < rows; ++i) indptr[i + 1] += indptr[i];
    indices.reserve(indptr[rows]);
    for (const Ints& mine : found) indices.insert(indices.end(), mine.begin(), mine.end());
}

template <int b>
CoarseMatrix galerkin(const Graph& g, const double* A, const Prolongator& P, const Transposed& columns,
                      int32_t count) {
    Ints product_pointer, product_columns;
    union_pattern(
        g.rows, count,
        [&](int64_t i, const auto& add) {
            if (P.indptr[i] == P.indptr[i + 1]) return;
            for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k) {
                const int32_t j = g.indices[k];
                add(P.indices.data() + P.indptr[j], P.indices.data() + P.indptr[j + 1]);
            }
        },
        product_pointer, product_columns);
    CoarseMatrix C;
    union_pattern(
        count, count,
        [&](int64_t I, const auto& add) {
            for (int32_t k = columns.indptr[I]; k < columns.indptr[I + 1]; ++k) {
                const int32_t i = columns.rows[k];
                add(product_columns.data() + product_pointer[i], product_columns.data() + product_pointer[i + 1]);
            }
        },
        C.indptr, C.indices);
    C.data.assign(C.indices.size() * MODES * MODES, 0.0);
    const int64_t slabs = wanted_threads() > 1 ? 2 * wanted_threads() : 1;
    parallel(slabs, [&](int64_t s) {
        galerkin_some(Galerkin<b>{g, A, P, product_pointer, product_columns, C, count * s / slabs,
                                  count * (s + 1) / slabs});
    });
    // Components without stiffness (modes that an aggregate cannot tell apart) stand alone.
    for (int32_t I = 0; I < count; ++I)
        for (int32_t k = C.indptr[I]; k < C.indptr[I + 1]; ++k)
            if (C.indices[k] == I)
                for (int c = 0; c < MODES; ++c) {
                    double& diagonal = C.data[static_cast<int64_t>(k) * MODES * MODES + c * (MODES + 1)];
                    if (!(diagonal > 0)) diagonal = 1;
                }
    return C;
}

}  // namespace kl
