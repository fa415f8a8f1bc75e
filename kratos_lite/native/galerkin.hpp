// The Galerkin product P^T A P; every sum runs in ascending order of rows, whoever computes it.

#pragma once
#include "aggregation.hpp"

namespace kl {

// Entries of each column, in ascending rows.
struct Transposed {
    Ints indptr, rows, entries;
    Transposed() = default;
    Transposed(int64_t n, const Ints& row_pointer, const Ints& columns) : rows(columns.size()) {
        members_of(columns, n, indptr, entries);
        Ints row(columns.size());
        for (size_t i = 0; i + 1 < row_pointer.size(); ++i) {
            if (i % MANY == 0) look();
            std::fill(row.begin() + row_pointer[i], row.begin() + row_pointer[i + 1], static_cast<int32_t>(i));
        }
        for (size_t k = 0; k < entries.size(); ++k) rows[k] = row[entries[k]];
    }
};

// A matrix of 6x6 blocks in rows.
struct CoarseMatrix {
    Ints indptr, indices;
    Doubles data;
};

// Coarse rows [first, last) of C = P^T A P.  Fine rows, those of `columns`, come in ascending order; A P, whose
// pattern is given, exists for one row.
template <int b>
KL_INLINE void galerkin_rows(const Graph& g, const double* A, const Prolongator& P, const Transposed& columns,
                             const CoarseMatrix& AP, CoarseMatrix& C, int64_t first, int64_t last) {
    constexpr int size = b * MODES;
    Doubles product;
    int32_t begin = INT32_MAX, end = 0;
    for (int64_t I = first; I < last; ++I)
        if (columns.indptr[I] < columns.indptr[I + 1]) {
            begin = std::min(begin, columns.rows[columns.indptr[I]]);
            end = std::max(end, columns.rows[columns.indptr[I + 1] - 1] + 1);
        }
    for (int32_t i = begin; i < end; ++i) {
        if (i % 64 == 0) look();
        const int32_t p0 = P.indptr[i], p1 = P.indptr[i + 1];
        if (p0 == p1 || P.indices[p1 - 1] < first || P.indices[p0] >= last) continue;
        const int32_t start = AP.indptr[i], count = AP.indptr[i + 1] - start;
        const int32_t* columns = &AP.indices[start];
        product.assign(static_cast<size_t>(count) * size, 0.0);
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k) {
            const int32_t j = g.indices[k];
            const int32_t* at = columns;
            for (int32_t q = P.indptr[j]; q < P.indptr[j + 1]; ++q) {
                while (*at < P.indices[q]) ++at;
                add_product<b, b>(&product[(at - columns) * size], A + static_cast<int64_t>(k) * b * b,
                                  &P.data[static_cast<int64_t>(q) * size]);
            }
        }
        for (int32_t p = p0; p < p1; ++p) {
            const int32_t I = P.indices[p];
            if (I < first || I >= last) continue;
            const int32_t* at = &C.indices[C.indptr[I]];
            for (int32_t c = 0; c < count; ++c) {
                while (*at < columns[c]) ++at;
                add_transposed_product<MODES, b>(&C.data[(at - C.indices.data()) * MODES * MODES],
                                                 &P.data[static_cast<int64_t>(p) * size], &product[c * size]);
            }
        }
    }
}

// The sum over the rows of g; P may have more.
inline CoarseMatrix galerkin_sum(int b, const Graph& g, const double* A, const Prolongator& P,
                                 const Transposed& columns, int32_t count) {
    CoarseMatrix AP, C;
    UnionRows(g.rows, count, [&](int64_t i, const auto& add) {
        if (P.indptr[i] == P.indptr[i + 1]) return;
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k)
            for (int32_t q = P.indptr[g.indices[k]]; q < P.indptr[g.indices[k] + 1]; ++q) add(P.indices[q]);
    }).copy_to(AP.indptr, AP.indices);
    UnionRows(count, count, [&](int64_t I, const auto& add) {
        for (int32_t k = columns.indptr[I]; k < columns.indptr[I + 1]; ++k)
            for (int32_t q = AP.indptr[columns.rows[k]]; q < AP.indptr[columns.rows[k] + 1]; ++q) add(AP.indices[q]);
    }).copy_to(C.indptr, C.indices);
    C.data.assign(C.indices.size() * MODES * MODES, 0.0);
    const int64_t slabs = wanted_threads() > 1 ? 2 * wanted_threads() : 1;
    parallel(slabs, [&](int64_t s) {
        const int64_t first = count * s / slabs, last = count * (s + 1) / slabs;
        with_size(b, [&](auto B) {
            dispatch<double>([&](auto) KL_INLINE_LAMBDA {
                galerkin_rows<decltype(B)::value>(g, A, P, columns, AP, C, first, last);
            });
        });
    });
    return C;
}

inline CoarseMatrix galerkin(int b, const Graph& g, const double* A, const Prolongator& P, const Transposed& columns,
                             int32_t count) {
    CoarseMatrix C = galerkin_sum(b, g, A, P, columns, count);
    // Components without stiffness (modes that an aggregate cannot tell apart) stand alone.
    for (int32_t I = 0; I < count; ++I)
        for (int32_t k = C.indptr[I]; k < C.indptr[I + 1]; ++k)
            for (int c = 0; C.indices[k] == I && c < MODES; ++c) {
                double& diagonal = C.data[static_cast<int64_t>(k) * MODES * MODES + c * (MODES + 1)];
                if (!(diagonal > 0)) diagonal = 1;
            }
    return C;
}

}  // namespace kl
