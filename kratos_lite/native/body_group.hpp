// Groups of bodies, one in each SIMD lane, and small dense algebra over them.
//
// A group holds each number of LANES bodies side by side (a Pack).  What a lane computes does not
// depend on its neighbors, nor on how many of them there are.

#pragma once
#include <cmath>
#include <cstdint>

#include "isa.hpp"

namespace kl {

constexpr int LANES = 8;
typedef double Pack[LANES];

// Clang forgets that a vec may lie anywhere where it is a type parameter of a template: there it takes vectors that
// are aligned to their size. Groups, whose packs they are loaded from, are aligned to a pack.
template <int V>
struct lanes_of {
#if defined(__clang__)
    typedef double type __attribute__((vector_size(V * sizeof(double))));
#else
    typedef vec<double, V> type;
#endif
};

// In what follows D is a vector of doubles, matrices are row-major and results come last.

template <int K, class D>
KL_INLINE void load(const Pack* rows, int at, D* x) {
    for (int k = 0; k < K; ++k) x[k] = *reinterpret_cast<const D*>(rows[k] + at);
}

template <int K, class D>
KL_INLINE void store(const D* x, int at, Pack* rows) {
    for (int k = 0; k < K; ++k) *reinterpret_cast<D*>(rows[k] + at) = x[k];
}

template <int K, class D>
KL_INLINE void dot(const D* x, const D* y, D& sum) {
    sum = x[0] * y[0];
    for (int k = 1; k < K; ++k) sum += x[k] * y[k];
}

template <class D>
KL_INLINE void square_root(D& x) {
    for (unsigned l = 0; l < sizeof(D) / sizeof(double); ++l) x[l] = std::sqrt(x[l]);
}

template <class M>
KL_INLINE bool any(const M& mask) {
    bool found = false;
    for (unsigned l = 0; l < sizeof(M) / sizeof(int64_t); ++l) found |= mask[l] != 0;
    return found;
}

template <class D>
KL_INLINE void product(const D* A, const D* B, D* C) {
    for (int i = 0; i < 9; i += 3)
        for (int j = 0; j < 3; ++j) C[i + j] = A[i] * B[j] + A[i + 1] * B[3 + j] + A[i + 2] * B[6 + j];
}

template <class D>
KL_INLINE void apply(const D* A, const D* x, D* y) {
    for (int i = 0; i < 3; ++i) y[i] = A[3 * i] * x[0] + A[3 * i + 1] * x[1] + A[3 * i + 2] * x[2];
}

template <class D>
KL_INLINE void apply_transposed(const D* A, const D* x, D* y) {
    for (int i = 0; i < 3; ++i) y[i] = A[i] * x[0] + A[3 + i] * x[1] + A[6 + i] * x[2];
}

template <class D>
KL_INLINE void cross(const D* a, const D* b, D* c) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

// A x = b by cross products of the rows of A.
template <class D>
KL_INLINE void solve3(const D* A, const D* b, D* x) {
    D yz[3], zx[3], xy[3], det;
    cross(A + 3, A + 6, yz);
    cross(A + 6, A, zx);
    cross(A, A + 3, xy);
    dot<3>(A, yz, det);
    for (int i = 0; i < 3; ++i) x[i] = (yz[i] * b[0] + zx[i] * b[1] + xy[i] * b[2]) / det;
}

// A x = b with a matrix A near a symmetric positive definite one, so without pivots; A is lost, x comes in b.
template <int N, class D>
KL_INLINE void solve(D* A, D* b) {
    for (int p = 0; p < N; ++p) {
        const D inverse = 1.0 / A[N * p + p];
        for (int i = p + 1; i < N; ++i) {
            const D factor = A[N * i + p] * inverse;
            for (int j = p + 1; j < N; ++j) A[N * i + j] -= factor * A[N * p + j];
            b[i] -= factor * b[p];
        }
        A[N * p + p] = inverse;
    }
    for (int p = N; p-- > 0;) {
        for (int j = p + 1; j < N; ++j) b[p] -= A[N * p + j] * b[j];
        b[p] *= A[N * p + p];
    }
}

// sin t / t, (1 - cos t) / t² and (t - sin t) / t³ of t²: Taylor series up to t = 1, beyond it the library's.
template <class D>
KL_INLINE void coefficients(const D& t2, D& a, D& b, D& c) {
    constexpr int TERMS = 9;
    a = b = c = D{} + 1.0;
    for (int k = TERMS; k > 0; --k) {
        a = 1.0 - a * t2 * (1.0 / (2 * k * (2 * k + 1)));
        b = 1.0 - b * t2 * (1.0 / ((2 * k + 1) * (2 * k + 2)));
        c = 1.0 - c * t2 * (1.0 / ((2 * k + 2) * (2 * k + 3)));
    }
    b *= 1.0 / 2;
    c *= 1.0 / 6;
    if (!any(t2 > 1.0)) return;
    for (unsigned l = 0; l < sizeof(D) / sizeof(double); ++l) {
        if (!(t2[l] > 1)) continue;
        const double t = std::sqrt(t2[l]), half = std::sin(t / 2) / t;
        a[l] = std::sin(t) / t;
        b[l] = 2 * half * half;
        c[l] = (t - std::sin(t)) / (t * t2[l]);
    }
}

// R = 1 + a ψ^ + b ψ^ ψ^, with the coefficients above.
template <class D>
KL_INLINE void rotation(const D* psi, const D& t2, const D& a, const D& b, D* R) {
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        R[3 * i + i] = 1.0 - b * (t2 - psi[i] * psi[i]);
        R[3 * i + j] = b * psi[i] * psi[j] - a * psi[k];
        R[3 * j + i] = b * psi[i] * psi[j] + a * psi[k];
    }
}

// R = exp(s w)
template <class D>
KL_INLINE void rotation(const D* w, double s, D* R) {
    D t2, a, b, c;
    const D psi[3] = {s * w[0], s * w[1], s * w[2]};
    dot<3>(psi, psi, t2);
    coefficients(t2, a, b, c);
    rotation(psi, t2, a, b, R);
}

}  // namespace kl
