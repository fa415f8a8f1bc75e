// Polynomials fitted to values at points: one for each patch of elements, by least squares.
//
// Coordinates of a patch are those along the principal axes of its points, in units of their spread, so
// that a fit depends neither on the unit of length nor on how the body lies.  Monomials stand by degree; one
// that the points of a patch cannot tell from those before it is left out.

#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "isa.hpp"

namespace kl {

constexpr int TERMS = 20, ROW = 32;  // monomials up to degree 3; these and six values, padded
constexpr double DEPENDENT = 1e-3;   // share of a monomial that those before it leave
constexpr double NOTHING = 1e-6;      // sum of squares of a monomial / that of 1, below which it is rounding
constexpr double FLAT = 1e-12;       // least spread along an axis / largest, squared
constexpr double ALIGNED = 1e-6;     // share of a product of inertia that counts as rounding

struct Fit {
    const double* X;         // (s, 3) places
    const double* values;    // (s, 6)
    const int32_t* offset;   // (m + 1) first sample of each element
    const int32_t* start;    // (p + 1) first entry of each patch
    const int32_t* elements; // its elements
    const double* weights;   // their weights
    const int32_t* degree;   // (p) of the polynomials
    const int32_t* means;    // (p) 1 where means of elements are fitted if there are enough of them
    const double* mean;      // (m, 9) mean place and values of each element, if there are any such
    double* frame;           // (p, 12) origin, and rows of the map to local coordinates
    double* terms;           // (p, TERMS, 6)
};

inline int monomials(int degree) { return (degree + 1) * (degree + 2) * (degree + 3) / 6; }

// 1 x y z xx yy zz xy yz zx xxx yyy zzz xxy xxz yyx yyz zzx zzy xyz
KL_INLINE void powers(const double* y, int degree, double* p) {
    p[0] = 1;
    if (degree < 1) return;
    for (int i = 0; i < 3; ++i) p[1 + i] = y[i];
    if (degree < 2) return;
    for (int i = 0; i < 3; ++i) {
        p[4 + i] = y[i] * y[i];
        p[7 + i] = y[i] * y[(i + 1) % 3];
    }
    if (degree < 3) return;
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        p[10 + i] = p[4 + i] * y[i];
        p[13 + 2 * i] = p[4 + i] * y[std::min(j, k)];
        p[14 + 2 * i] = p[4 + i] * y[std::max(j, k)];
    }
    p[19] = y[0] * y[1] * y[2];
}

KL_INLINE void local(const double* frame, const double* x, double* y) {
    for (int i = 0; i < 3; ++i) {
        y[i] = 0;
        for (int j = 0; j < 3; ++j) y[i] += frame[3 + 3 * i + j] * (x[j] - frame[j]);
    }
}

// Eigenvectors of a symmetric matrix in the rows of R, by the method of Jacobi, largest eigenvalue first.
inline void principal_axes(double (&A)[3][3], double (&R)[3][3], double (&spread)[3]) {
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) R[i][j] = i == j;
    const double size = A[0][0] + A[1][1] + A[2][2];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            if (i != j && std::fabs(A[i][j]) <= ALIGNED * std::sqrt(A[i][i] * A[j][j])) A[i][j] = 0;
    for (int sweep = 0; sweep < 30; ++sweep)
        for (int p = 0; p < 2; ++p)
            for (int q = p + 1; q < 3; ++q) {
                if (std::fabs(A[p][q]) <= 1e-18 * size) continue;
                const double theta = (A[q][q] - A[p][p]) / (2 * A[p][q]);
                const double t = (theta < 0 ? -1 : 1) / (std::fabs(theta) + std::sqrt(theta * theta + 1));
                const double c = 1 / std::sqrt(t * t + 1), s = t * c;
                for (int k = 0; k < 3; ++k) {
                    const double a = A[k][p], b = A[k][q];
                    A[k][p] = c * a - s * b;
                    A[k][q] = s * a + c * b;
                }
                for (int k = 0; k < 3; ++k) {
                    const double a = A[p][k], b = A[q][k], u = R[p][k], v = R[q][k];
                    A[p][k] = c * a - s * b;
                    A[q][k] = s * a + c * b;
                    R[p][k] = c * u - s * v;
                    R[q][k] = s * u + c * v;
                }
            }
    int order[3] = {0, 1, 2};
    std::stable_sort(order, order + 3, [&](int i, int j) { return A[i][i] > A[j][j]; });
    double sorted[3][3];
    for (int i = 0; i < 3; ++i) {
        spread[i] = A[order[i]][order[i]];
        for (int j = 0; j < 3; ++j) sorted[i][j] = R[order[i]][j];
    }
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) R[i][j] = sorted[i][j];
}

// The samples of a patch one after another, or the means of its elements: f(place, values, weight).
template <class F>
KL_INLINE void samples(const Fit& w, int64_t patch, bool means, const F& f) {
    for (int32_t at = w.start[patch]; at < w.start[patch + 1]; ++at) {
        const int32_t first = w.offset[w.elements[at]], last = w.offset[w.elements[at] + 1];
        if (!means) {
            for (int32_t s = first; s < last; ++s) f(w.X + 3 * int64_t{s}, w.values + 6 * int64_t{s}, w.weights[at]);
            continue;
        }
        const double* mean = w.mean + 9 * int64_t{w.elements[at]};
        f(mean, mean + 3, w.weights[at]);
    }
}

inline void mean_samples(const Fit& w, int64_t element, double* mean) {
    const int32_t first = w.offset[element], last = w.offset[element + 1];
    for (int i = 0; i < 9; ++i) mean[i] = 0;
    for (int32_t s = first; s < last; ++s) {
        for (int i = 0; i < 3; ++i) mean[i] += w.X[3 * int64_t{s} + i] / (last - first);
        for (int i = 0; i < 6; ++i) mean[3 + i] += w.values[6 * int64_t{s} + i] / (last - first);
    }
}

inline void place(const Fit& w, int64_t patch, bool means, double* frame) {
    double sum[3] = {}, A[3][3] = {}, R[3][3], spread[3], n = 0;
    samples(w, patch, means, [&](const double* x, const double*, double) {
        ++n;
        for (int i = 0; i < 3; ++i) sum[i] += x[i];
    });
    for (int i = 0; i < 3; ++i) frame[i] = sum[i] / n;
    samples(w, patch, means, [&](const double* x, const double*, double) {
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) A[i][j] += (x[i] - frame[i]) * (x[j] - frame[j]) / n;
    });
    principal_axes(A, R, spread);
    for (int i = 0; i < 3; ++i) {
        const double least = std::fmax(spread[i], FLAT * spread[0]);
        for (int j = 0; j < 3; ++j) frame[3 + 3 * i + j] = least > 0 ? R[i][j] / std::sqrt(least) : 0.0;
    }
}

// Solves the normal equations in rows of M, which hold six right-hand sides behind the matrix; false if a
// monomial had to be left out.
inline bool solve(double (&M)[TERMS][ROW], int n, double* terms) {
    bool used[TERMS], all = true;
    double diagonal[TERMS];
    for (int i = 0; i < n; ++i) diagonal[i] = M[i][i];
    for (int i = 0; i < n; ++i) {  // M = L D L^T, from the left; rows below are reduced at once
        used[i] = M[i][i] > DEPENDENT * std::fmax(diagonal[i], NOTHING * diagonal[0]);
        all &= used[i];
        if (!used[i]) continue;
        for (int k = i + 1; k < n; ++k) {
            const double factor = M[i][k] / M[i][i];
            for (int j = k; j < n; ++j) M[k][j] -= factor * M[i][j];
            for (int j = TERMS; j < TERMS + 6; ++j) M[k][j] -= factor * M[i][j];
        }
    }
    for (int i = n - 1; i >= 0; --i)
        for (int c = 0; c < 6; ++c) {
            double sum = M[i][TERMS + c];
            for (int k = i + 1; k < n; ++k) sum -= M[i][k] * terms[6 * k + c];
            terms[6 * i + c] = used[i] ? sum / M[i][i] : 0.0;
        }
    for (int i = 6 * n; i < 6 * TERMS; ++i) terms[i] = 0;
    return all;
}

template <int V>
KL_INLINE bool fit_one(const Fit& w, int64_t patch, bool means) {
    typedef vec<double, V> Vec;
    double *frame = w.frame + 12 * patch, *terms = w.terms + 6 * TERMS * patch;
    place(w, patch, means, frame);
    const int n = monomials(w.degree[patch]);
    double M[TERMS][ROW] = {};
    samples(w, patch, means, [&](const double* x, const double* values, double weight) KL_INLINE_LAMBDA {
        double y[3], row[ROW] = {};
        local(frame, x, y);
        powers(y, w.degree[patch], row);
        for (int c = 0; c < 6; ++c) row[TERMS + c] = values[c];
        for (int i = 0; i < n; ++i) {
            const double factor = weight * row[i];
            for (int v = 0; v < ROW / V; ++v) {
                if (V * v >= n && V * (v + 1) <= TERMS) continue;
                *reinterpret_cast<Vec*>(M[i] + V * v) += factor * *reinterpret_cast<const Vec*>(row + V * v);
            }
        }
    });
    return solve(M, n, terms);
}

struct FitRange {
    const Fit* fit;
    int64_t first, last;
};

template <int V>
KL_INLINE void fit_body(const FitRange& range) {
    for (int64_t patch = range.first; patch < range.last; ++patch) {
        if (range.fit->means[patch] && fit_one<V>(*range.fit, patch, true)) continue;
        fit_one<V>(*range.fit, patch, false);
    }
}

KL_DISPATCH(fit_patches, fit_body, const FitRange&)

}  // namespace kl
