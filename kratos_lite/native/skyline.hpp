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

namespace kl {

// A matrix in rows up to the diagonal, each from its first entry on, or its Cholesky factor.
template <class T>
struct Skyline {
    std::vector<int64_t> at;  // where each row starts
    std::vector<T> rows;      // left of the diagonal
    std::vector<T> pivots;    // the diagonal, or one over it: zero where there is no stiffness
};

template <class T, int V>
KL_INLINE T dot_product(const T* a, const T* b, int64_t n) {
    typedef vec<T, V> lane;
    lane lanes = {};
    T sum = 0;
    int64_t k = 0;
    for (; k + V <= n; k += V) lanes += *reinterpret_cast<const lane*>(a + k) * *reinterpret_cast<const lane*>(b + k);
    if (k)
        for (int v = 0; v < V; ++v) sum += lanes[v];
    for (; k < n; ++k) sum += a[k] * b[k];
    return sum;
}

// Rows [first, last) of a skyline, which no others are coupled to.
struct Factor {
    Skyline<double>& A;
    int64_t first, last;
};

template <int V>
KL_INLINE void factor_rows(const Factor& f) {
    Skyline<double>& A = f.A;
    for (int64_t i = f.first; i < f.last; ++i) {
        const int64_t start = i - (A.at[i + 1] - A.at[i]);
        double* row = A.rows.data() + A.at[i] - start;
        for (int64_t j = start; j < i; ++j) {
            const int64_t other = j - (A.at[j + 1] - A.at[j]), from = std::max(start, other);
            const double* column = A.rows.data() + A.at[j] - other;
            row[j] = (row[j] - dot_product<double, V>(row + from, column + from, j - from)) * A.pivots[j];
        }
        const double left = A.pivots[i] - dot_product<double, V>(row + start, row + start, i - start);
        A.pivots[i] = left > 1e-14 * A.pivots[i] ? 1 / std::sqrt(left) : 0;
    }
}
KL_DISPATCH(factorise_some, factor_rows, double, const Factor&)

// x = (L L^T)^-1 x on rows [first, last); x[0] belongs to the first.
struct Substitution {
    const Skyline<float>& L;
    int64_t first, last;
    float* x;
};

template <int V>
KL_INLINE void substitute_rows(const Substitution& s) {
    typedef vec<float, V> lane;
    const Skyline<float>& L = s.L;
    for (int64_t i = s.first; i < s.last; ++i) {
        const int64_t n = L.at[i + 1] - L.at[i];
        float& x = s.x[i - s.first];
        x = (x - dot_product<float, V>(L.rows.data() + L.at[i], &x - n, n)) * L.pivots[i];
    }
    for (int64_t i = s.last; i-- > s.first;) {
        const int64_t n = L.at[i + 1] - L.at[i];
        const float* row = L.rows.data() + L.at[i];
        const float x = s.x[i - s.first] *= L.pivots[i];
        float* others = s.x + (i - s.first) - n;
        int64_t k = 0;
        for (; k + V <= n; k += V) *reinterpret_cast<lane*>(others + k) -= *reinterpret_cast<const lane*>(row + k) * x;
        for (; k < n; ++k) others[k] -= row[k] * x;
    }
}
KL_DISPATCH(substitute_some, substitute_rows, float, const Substitution&)

// The same for six right sides, X (last - first, 6).
struct SixSubstitutions {
    const Skyline<double>& L;
    int64_t first, last;
    double* X;
};

template <int V>
KL_INLINE void substitute_six(const SixSubstitutions& s) {
    const Skyline<double>& L = s.L;
    for (int64_t i = s.first; i < s.last; ++i) {
        const int64_t n = L.at[i + 1] - L.at[i];
        double* own = s.X + 6 * (i - s.first);
        Six x = Six::load(own), scaled = {};
        for (int64_t k = 0; k < n; ++k) x.add(-L.rows[L.at[i] + k], Six::load(own + 6 * (k - n)));
        scaled.add(L.pivots[i], x);
        scaled.store(own);
    }
    for (int64_t i = s.last; i-- > s.first;) {
        const int64_t n = L.at[i + 1] - L.at[i];
        double* own = s.X + 6 * (i - s.first);
        Six scaled = {};
        scaled.add(L.pivots[i], Six::load(own));
        scaled.store(own);
        for (int64_t k = 0; k < n; ++k) {
            Six x = Six::load(own + 6 * (k - n));
            x.add(-L.rows[L.at[i] + k], scaled);
            x.store(own + 6 * (k - n));
        }
    }
}
KL_DISPATCH(substitute_six_some, substitute_six, double, const SixSubstitutions&)

}  // namespace kl
