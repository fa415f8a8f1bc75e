// Symmetric positive definite matrices within an envelope: Cholesky factors and solutions.
//
// Source: George & Liu, Computer Solution of Large Sparse Positive Definite Systems (1981), chapter 4.

#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "dense.hpp"
#include "isa.hpp"
#include "threads.hpp"

namespace kl {

// A matrix in rows up to the diagonal, each from its first entry on, or its Cholesky factor.
template <class T>
struct Skyline {
    std::vector<int64_t> at;  // where each row starts
    std::vector<T> rows;      // left of the diagonal
    std::vector<T> pivots;    // the diagonal, or one over it: zero where there is no stiffness

    int64_t length(int64_t i) const { return at[i + 1] - at[i]; }
    T* row(int64_t i) { return rows.data() + at[i]; }
    const T* row(int64_t i) const { return rows.data() + at[i]; }
};

template <class T, int V>
KL_INLINE T dot_product(const T* a, const T* b, int64_t n) {
    typedef vec<T, V> Vec;
    Vec partial = {};
    T sum = 0;
    int64_t k = 0;
    for (; k + V <= n; k += V) partial += *reinterpret_cast<const Vec*>(a + k) * *reinterpret_cast<const Vec*>(b + k);
    if (k)
        for (int v = 0; v < V; ++v) sum += partial[v];
    for (; k < n; ++k) sum += a[k] * b[k];
    return sum;
}

// Factorize rows [first, last), which no others are coupled to; a pivot of no more than `least` is zero.
template <int V>
KL_INLINE void factorize_rows(Skyline<double>& A, int64_t first, int64_t last, double least = 0) {
    for (int64_t i = first; i < last; ++i) {
        if (i % 64 == 0) look();
        const int64_t start = i - A.length(i);
        double* row = A.row(i) - start;
        for (int64_t j = start; j < i; ++j) {
            const int64_t other = j - A.length(j), from = std::max(start, other);
            const double* column = A.row(j) - other;
            row[j] = (row[j] - dot_product<double, V>(row + from, column + from, j - from)) * A.pivots[j];
        }
        const double left = A.pivots[i] - dot_product<double, V>(row + start, row + start, i - start);
        A.pivots[i] = left > std::max(least, 1e-14 * A.pivots[i]) ? 1 / std::sqrt(left) : 0;
    }
}

// x = (L L^T)^-1 x on rows [first, last); x[0] belongs to the first.
template <int V, class T>
KL_INLINE void substitute_rows(const Skyline<T>& L, int64_t first, int64_t last, T* x) {
    typedef vec<T, V> Vec;
    for (int64_t i = first; i < last; ++i) {
        const int64_t n = L.length(i);
        T& own = x[i - first];
        own = (own - dot_product<T, V>(L.row(i), &own - n, n)) * L.pivots[i];
    }
    for (int64_t i = last; i-- > first;) {
        const int64_t n = L.length(i);
        const T* row = L.row(i);
        const T own = x[i - first] *= L.pivots[i];
        T* others = x + (i - first) - n;
        int64_t k = 0;
        for (; k + V <= n; k += V) *reinterpret_cast<Vec*>(others + k) -= *reinterpret_cast<const Vec*>(row + k) * own;
        for (; k < n; ++k) others[k] -= row[k] * own;
    }
}

// The same for six right sides, X (last - first, 6).
KL_INLINE void substitute_six(const Skyline<double>& L, int64_t first, int64_t last, double* X) {
    for (int64_t i = first; i < last; ++i) {
        const int64_t n = L.length(i);
        const double* row = L.row(i);
        double* own = X + 6 * (i - first);
        Six x = Six::load(own), scaled = {};
        for (int64_t k = 0; k < n; ++k) x.add(-row[k], Six::load(own + 6 * (k - n)));
        scaled.add(L.pivots[i], x);
        scaled.store(own);
    }
    for (int64_t i = last; i-- > first;) {
        const int64_t n = L.length(i);
        const double* row = L.row(i);
        double* own = X + 6 * (i - first);
        Six scaled = {};
        scaled.add(L.pivots[i], Six::load(own));
        scaled.store(own);
        for (int64_t k = 0; k < n; ++k) {
            Six x = Six::load(own + 6 * (k - n));
            x.add(-row[k], scaled);
            x.store(own + 6 * (k - n));
        }
    }
}

}  // namespace kl
