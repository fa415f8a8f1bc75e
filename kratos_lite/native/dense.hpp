// Small dense blocks of fixed size, row-major, and the Cholesky factor of a small full matrix.

#pragma once
#include <cmath>
#include <cstdint>
#include <vector>

#include "isa.hpp"

namespace kl {

constexpr int MODES = 6;  // near-nullspace vectors of a multigrid, and unknowns of a coarse node

// f(b) with the size of blocks, 3 or 6, as a constant.
template <class F>
auto with_size(int b, const F& f) {
    return b == 3 ? f(std::integral_constant<int, 3>()) : f(std::integral_constant<int, MODES>());
}

// Rows of six numbers, as four and two lanes.
struct Six {
    typedef vec<double, 4> Four;
    typedef vec<double, 2> Two;
    Four a;
    Two b;
    static KL_INLINE Six load(const double* p) {
        return {*reinterpret_cast<const Four*>(p), *reinterpret_cast<const Two*>(p + 4)};
    }
    static KL_INLINE Six load(const float* p) {
        typedef vec<float, 4> Four32;
        typedef vec<float, 2> Two32;
        return {__builtin_convertvector(*reinterpret_cast<const Four32*>(p), Four),
                __builtin_convertvector(*reinterpret_cast<const Two32*>(p + 4), Two)};
    }
    KL_INLINE void store(double* p) const {
        *reinterpret_cast<Four*>(p) = a;
        *reinterpret_cast<Two*>(p + 4) = b;
    }
    KL_INLINE void add(double factor, const Six& other) {
        a += factor * other.a;
        b += factor * other.b;
    }
};

// c (R x 6) += a (R x K) b (K x 6)
template <int R, int K, class T>
KL_INLINE void add_product(double* c, const double* a, const T* b) {
    Six rows[K];
    for (int k = 0; k < K; ++k) rows[k] = Six::load(b + 6 * k);
    for (int r = 0; r < R; ++r) {
        Six sum = Six::load(c + 6 * r);
        for (int k = 0; k < K; ++k) sum.add(a[r * K + k], rows[k]);
        sum.store(c + 6 * r);
    }
}

// c (R x 6) += a^T b with a (K x R) and b (K x 6)
template <int R, int K, class T>
KL_INLINE void add_transposed_product(double* c, const T* a, const double* b) {
    Six rows[K];
    for (int k = 0; k < K; ++k) rows[k] = Six::load(b + 6 * k);
    for (int r = 0; r < R; ++r) {
        Six sum = Six::load(c + 6 * r);
        for (int k = 0; k < K; ++k) sum.add(a[k * R + r], rows[k]);
        sum.store(c + 6 * r);
    }
}

// The inverse of a symmetric positive definite n x n matrix by Gauss-Jordan; a pivot that is not
// positive, which belongs to a component without stiffness, gives a zero row and column.
template <int n>
inline void invert(const double* matrix, double* inverse) {
    double a[n][2 * n] = {};
    double scale = 0;
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) a[i][j] = matrix[i * n + j];
        a[i][n + i] = 1;
        scale = std::fmax(scale, std::fabs(matrix[i * n + i]));
    }
    bool dead[n] = {};
    for (int p = 0; p < n; ++p) {
        dead[p] = !(a[p][p] > 1e-14 * scale);
        if (dead[p]) continue;
        const double factor = 1 / a[p][p];
        for (int j = 0; j < 2 * n; ++j) a[p][j] *= factor;
        for (int i = 0; i < n; ++i) {
            if (i == p) continue;
            const double f = a[i][p];
            for (int j = 0; j < 2 * n; ++j) a[i][j] -= f * a[p][j];
        }
    }
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) inverse[i * n + j] = dead[i] || dead[j] ? 0 : a[i][n + j];
}

}  // namespace kl
