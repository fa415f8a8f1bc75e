// Nodal fields in elements: values at points, sums at nodes, and the energy of differences of stresses.
//
// The components of a value stand in the lanes of vectors, padded with zeros.

#pragma once
#include <algorithm>
#include <cstdint>

#include "isa.hpp"

namespace kl {

constexpr int WIDTH = 8;  // doubles of a padded value

// Values of some rows, padded: the rows of an element that its tables combine.
template <int C>
KL_INLINE void gather_rows(const double* values, const int32_t* rows, int64_t k, double* padded) {
    for (int64_t a = 0; a < k; ++a)
        for (int c = 0; c < C; ++c) padded[WIDTH * a + c] = values[C * int64_t{rows[a]} + c];
}

// sum += Σ_a factor_a row_a of padded rows.
template <int V, int C>
KL_INLINE void combine(const double* factors, const double* padded, int64_t k,
                       vec<double, V> (&sum)[(C + V - 1) / V]) {
    typedef vec<double, V> Vec;
    for (int64_t a = 0; a < k; ++a)
        for (int v = 0; v < (C + V - 1) / V; ++v)
            sum[v] += factors[a] * *reinterpret_cast<const Vec*>(padded + WIDTH * a + V * v);
}

struct Combination {
    const double* table;   // (s, k)
    const double* values;  // (n, C)
    const int32_t* rows;   // (m, k)
    int64_t s, k;
    double* out;  // (m, s, C)
    int64_t first, last;
};

template <int V, int C>
KL_INLINE void combine_body(const Combination& w) {
    constexpr int COUNT = (C + V - 1) / V;
    Workspace space(WIDTH * w.k);
    double* padded = space.data();
    for (int64_t e = w.first; e < w.last; ++e) {
        gather_rows<C>(w.values, w.rows + e * w.k, w.k, padded);
        for (int64_t i = 0; i < w.s; ++i) {
            vec<double, V> sum[COUNT] = {};
            combine<V, C>(w.table + i * w.k, padded, w.k, sum);
            const double* found = reinterpret_cast<const double*>(sum);
            for (int c = 0; c < C; ++c) w.out[C * (e * w.s + i) + c] = found[c];
        }
    }
}

template <int V>
KL_INLINE void combine_3_body(const Combination& w) { combine_body<V, 3>(w); }
template <int V>
KL_INLINE void combine_6_body(const Combination& w) { combine_body<V, 6>(w); }

KL_DISPATCH(combine_3, combine_3_body, const Combination&)
KL_DISPATCH(combine_6, combine_6_body, const Combination&)

// Nodal stresses and those of elements, twice; the second may be the first.
struct Differences {
    const double *nodal, *raw;        // (n, 6), (m, g, 6)
    const double *others, *other_raw;
    const int32_t* nodes;  // (m, k)
    const double *N, *dV;  // (g, k), (m, g)
    const double* S;       // (6, 6)
    int64_t k, g;
    double* out;  // (m)
    int64_t first, last;
};

// Nodal stresses of an element and, behind them, its own at its points, padded.
inline void gather_stresses(const Differences& w, const double* nodal, const double* raw, int64_t e, double* to) {
    gather_rows<6>(nodal, w.nodes + e * w.k, w.k, to);
    for (int64_t q = 0; q < w.g; ++q)
        for (int c = 0; c < 6; ++c) to[WIDTH * (w.k + q) + c] = raw[6 * (e * w.g + q) + c];
}

// N σ* - σ at a point.
template <int V>
KL_INLINE void difference(const Differences& w, int64_t q, const double* stresses,
                          vec<double, V> (&off)[(6 + V - 1) / V]) {
    for (int v = 0; v < (6 + V - 1) / V; ++v)
        off[v] = -*reinterpret_cast<const vec<double, V>*>(stresses + WIDTH * (w.k + q) + V * v);
    combine<V, 6>(w.N + q * w.k, stresses, w.k, off);
}

// out: ∫ (σ* - σ) S (σ*' - σ') dV of each element.
template <int V>
KL_INLINE void products_body(const Differences& w) {
    typedef vec<double, V> Vec;
    constexpr int COUNT = (6 + V - 1) / V;
    Workspace space(2 * WIDTH * (w.k + w.g) + 6 * WIDTH);
    double *first = space.data(), *second = first + WIDTH * (w.k + w.g), *S = second + WIDTH * (w.k + w.g);
    const bool same = w.nodal == w.others && w.raw == w.other_raw;
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) S[WIDTH * i + j] = w.S[6 * i + j];
    for (int64_t e = w.first; e < w.last; ++e) {
        gather_stresses(w, w.nodal, w.raw, e, first);
        if (!same) gather_stresses(w, w.others, w.other_raw, e, second);
        Vec total[COUNT] = {};
        for (int64_t q = 0; q < w.g; ++q) {
            Vec off[COUNT], other[COUNT], strain[COUNT] = {};
            difference<V>(w, q, first, off);
            for (int v = 0; v < COUNT; ++v) other[v] = off[v];
            if (!same) difference<V>(w, q, second, other);
            for (int j = 0; j < 6; ++j)
                for (int v = 0; v < COUNT; ++v)
                    strain[v] += other[j / V][j % V] * *reinterpret_cast<const Vec*>(S + WIDTH * j + V * v);
            for (int v = 0; v < COUNT; ++v) total[v] += w.dV[e * w.g + q] * off[v] * strain[v];
        }
        double sum = 0;
        for (int c = 0; c < 6; ++c) sum += total[c / V][c % V];
        w.out[e] = sum;
    }
}

KL_DISPATCH(products, products_body, const Differences&)

}  // namespace kl
