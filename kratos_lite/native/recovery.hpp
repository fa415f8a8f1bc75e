// Polynomials fitted to values at points: one for each patch of elements, by least squares.
//
// Coordinates of a patch are those along the principal axes of its points, in units of their spread, so
// that a fit depends neither on the unit of length nor on how the body lies.  Monomials stand by degree; one
// that the points of a patch cannot tell from those before it is left out.  What means of elements cannot tell,
// as across a single layer, is then fitted to what they leave of the samples.

#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "isa.hpp"

namespace kl {

constexpr int TERMS = 20, ROW = 32;  // monomials up to degree 3; these and six values, padded
constexpr double DEPENDENT = 1e-3;   // share of a monomial that those before it leave
constexpr double NOTHING = 1e-6;      // sum of squares of a monomial / that of 1, below which it is rounding
constexpr double UNTOLD = 1e-2;       // the same for means of elements, below which samples tell it
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
    const int32_t* means;    // (p) 1 where means of elements are fitted as far as they tell
    const double* summary;   // (m, SUMMARY) of each element
    double* frame;           // (p, 12) origin, and rows of the map to local coordinates
    double* terms;           // (p, most, 6)
    int most;                // monomials of the highest degree
};

inline int monomials(int degree) { return (degree + 1) * (degree + 2) * (degree + 3) / 6; }

inline int degree_of(int count) { return count <= 1 ? 0 : count <= 4 ? 1 : count <= 10 ? 2 : 3; }

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
    for (int i = 0; i < 3; ++i) spread[i] = std::sqrt(A[i][i]);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            if (i != j && std::fabs(A[i][j]) <= ALIGNED * spread[i] * spread[j]) A[i][j] = 0;
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

// What a patch needs of an element: mean place and values of its samples, and Σ (x - mean) (x - mean)^T.
constexpr int SUMMARY = 15;

inline void summarize(const Fit& w, int64_t element, double* out) {
    const int32_t first = w.offset[element], last = w.offset[element + 1];
    for (int i = 0; i < SUMMARY; ++i) out[i] = 0;
    for (int32_t s = first; s < last; ++s) {
        for (int i = 0; i < 3; ++i) out[i] += w.X[3 * int64_t{s} + i];
        for (int i = 0; i < 6; ++i) out[3 + i] += w.values[6 * int64_t{s} + i];
    }
    if (last - first < 2) return;
    for (int i = 0; i < 9; ++i) out[i] /= last - first;
    for (int32_t s = first; s < last; ++s)
        for (int i = 0, c = 9; i < 3; ++i)
            for (int j = i; j < 3; ++j)
                out[c++] += (w.X[3 * int64_t{s} + i] - out[i]) * (w.X[3 * int64_t{s} + j] - out[j]);
}

inline void place(const Fit& w, int64_t patch, double* frame) {
    double sum[3] = {}, A[3][3] = {}, R[3][3], spread[3], n = 0;
    const auto each = [&](const auto& f) {
        for (int32_t at = w.start[patch]; at < w.start[patch + 1]; ++at) {
            const int64_t e = w.elements[at];
            f(w.summary + SUMMARY * e, static_cast<double>(w.offset[e + 1] - w.offset[e]));
        }
    };
    each([&](const double* element, double count) {
        n += count;
        for (int i = 0; i < 3; ++i) sum[i] += count * element[i];
    });
    for (int i = 0; i < 3; ++i) frame[i] = sum[i] / n;
    each([&](const double* element, double count) {
        for (int i = 0, c = 9; i < 3; ++i)
            for (int j = i; j < 3; ++j, ++c)
                A[i][j] += element[c] + count * (element[i] - frame[i]) * (element[j] - frame[j]);
    });
    for (int i = 0; i < 3; ++i)
        for (int j = i; j < 3; ++j) A[j][i] = A[i][j] /= n;
    principal_axes(A, R, spread);
    for (int i = 0; i < 3; ++i) {
        const double least = std::fmax(spread[i], FLAT * spread[0]);
        const double scale = least > 0 ? 1 / std::sqrt(least) : 0.0;
        for (int j = 0; j < 3; ++j) frame[3 + 3 * i + j] = scale * R[i][j];
    }
}

// The equations of one patch: a row of monomials and values for each sample, the same monomials times the
// weight, and the normal equations with six right-hand sides behind the matrix, above its diagonal.
struct Equations {
    double *rows, *weighted;  // (samples, ROW), (samples, TERMS)
    double* weights;          // (samples)
    double (*M)[ROW];         // (TERMS)
    int64_t samples;
    int n, width;             // monomials; columns in use, a multiple of 8
    bool known[TERMS];        // monomials that are found
};

inline void fill(const Fit& w, int64_t patch, bool means, const double* frame, const double* terms, Equations& to) {
    to.samples = 0;
    const auto add = [&](const double* x, const double* values, double weight) {
        double y[3], *row = to.rows + ROW * to.samples;
        local(frame, x, y);
        powers(y, w.degree[patch], row);
        for (int c = 0; c < 6; ++c) row[to.n + c] = values[c];
        for (int i = 0; to.known[0] && i < to.n; ++i)
            for (int c = 0; c < 6; ++c) row[to.n + c] -= row[i] * terms[6 * i + c];
        to.weights[to.samples++] = weight;
    };
    for (int32_t at = w.start[patch]; at < w.start[patch + 1]; ++at) {
        const int64_t e = w.elements[at];
        const double* mean = w.summary + SUMMARY * e;
        if (means)
            add(mean, mean + 3, w.weights[at]);
        else
            for (int64_t s = w.offset[e]; s < w.offset[e + 1]; ++s)
                add(w.X + 3 * s, w.values + 6 * s, w.weights[at]);
    }
    for (int64_t s = 0; s < to.samples; ++s)  // once the rows have left the store buffer
        for (int i = 0; i < (to.n + 3) / 4 * 4; ++i) to.weighted[TERMS * s + i] = to.weights[s] * to.rows[ROW * s + i];
}

// Rows [i, i + 4) and COUNT vectors of columns of the normal equations.
template <int V, int COUNT>
KL_INLINE void accumulate(const Equations& at, int i, int column) {
    typedef vec<double, V> Vec;
    Vec sum[4][COUNT] = {};
    for (int64_t s = 0; s < at.samples; ++s) {
        const double *row = at.rows + ROW * s + column, *left = at.weighted + TERMS * s + i;
        for (int r = 0; r < 4; ++r)
            for (int v = 0; v < COUNT; ++v) sum[r][v] += left[r] * *reinterpret_cast<const Vec*>(row + V * v);
    }
    for (int r = 0; r < 4; ++r)
        for (int v = 0; v < COUNT; ++v) *reinterpret_cast<Vec*>(at.M[i + r] + column + V * v) = sum[r][v];
}

template <int V>
KL_INLINE void accumulate(const Equations& at) {
    for (int i = 0; i < at.n; i += 4) {
        int column = i / V * V;
        for (; column + 2 * V <= at.width; column += 2 * V) accumulate<V, 2>(at, i, column);
        if (column < at.width) accumulate<V, 1>(at, i, column);
    }
}

// Adds the terms not yet known; false if one had to be left out.
template <int V>
KL_INLINE bool solve(Equations& at, double nothing, double* terms) {
    typedef vec<double, V> Vec;
    double(*M)[ROW] = at.M;
    double diagonal[TERMS], inverse[TERMS];
    bool all = true;
    for (int i = 0; i < at.n; ++i) diagonal[i] = M[i][i];
    for (int i = 0; i < at.n; ++i) {  // M = L D L^T, from the left; rows below are reduced at once
        const bool used = !at.known[i] && M[i][i] > std::fmax(DEPENDENT * diagonal[i], nothing * diagonal[0]);
        at.known[i] |= used;
        all &= at.known[i];
        inverse[i] = used ? 1 / M[i][i] : 0.0;
        if (!used) continue;
        for (int k = i + 1; k < at.n; ++k) {
            const double factor = M[i][k] * inverse[i];
            for (int j = k / V * V; j < at.width; j += V)
                *reinterpret_cast<Vec*>(M[k] + j) -= factor * *reinterpret_cast<const Vec*>(M[i] + j);
        }
    }
    constexpr int PAD = 8;
    double right[TERMS * PAD] = {};
    for (int i = 0; i < at.n; ++i)
        for (int c = 0; c < 6; ++c) right[PAD * i + c] = M[i][at.n + c];
    for (int i = at.n - 1; i >= 0; --i) {
        Vec x[PAD / V];
        for (int v = 0; v < PAD / V; ++v) x[v] = inverse[i] * *reinterpret_cast<Vec*>(right + PAD * i + V * v);
        for (int c = 0; c < 6; ++c) terms[6 * i + c] += x[c / V][c % V];
        for (int k = 0; k < i; ++k)
            for (int v = 0; v < PAD / V; ++v) *reinterpret_cast<Vec*>(right + PAD * k + V * v) -= M[k][i] * x[v];
    }
    return all;
}

template <int V>
KL_INLINE bool fit_one(const Fit& w, int64_t patch, bool means, Equations& at) {
    double *frame = w.frame + 12 * patch, *terms = w.terms + 6 * w.most * patch;
    at.n = monomials(w.degree[patch]);
    at.width = (at.n + 6 + 7) / 8 * 8;
    fill(w, patch, means, frame, terms, at);
    accumulate<V>(at);
    return solve<V>(at, means ? UNTOLD : NOTHING * DEPENDENT, terms);
}

struct FitRange {
    const Fit* fit;
    int64_t first, last;
};

template <int V>
KL_INLINE void fit_body(const FitRange& range) {
    const Fit& w = *range.fit;
    int64_t most = 0;
    for (int64_t patch = range.first; patch < range.last; ++patch) {
        int64_t count = 0;
        for (int32_t at = w.start[patch]; at < w.start[patch + 1]; ++at)
            count += w.offset[w.elements[at] + 1] - w.offset[w.elements[at]];
        most = std::max(most, count);
    }
    Workspace space(TERMS * ROW + (ROW + TERMS + 1) * most);
    double *M = space.data(), *rows = M + TERMS * ROW, *weighted = rows + ROW * most;
    Equations at{rows, weighted, weighted + TERMS * most, reinterpret_cast<double(*)[ROW]>(M), 0, 0, 0, {}};
    for (int64_t patch = range.first; patch < range.last; ++patch) {
        place(w, patch, w.frame + 12 * patch);
        std::fill_n(w.terms + 6 * w.most * patch, 6 * w.most, 0.0);
        std::fill_n(at.known, TERMS, false);
        if (w.means[patch] && fit_one<V>(w, patch, true, at)) continue;
        fit_one<V>(w, patch, false, at);
    }
}

KL_DISPATCH(fit_patches, fit_body, const FitRange&)

struct Residuals {
    const double *frames, *terms, *X, *values, *E;
    const int32_t *nodes, *start, *patches;
    int count, degree;  // of the monomials
    int64_t k, s;       // nodes and points of an element
    double* out;        // (m, k, 6)
    int64_t first, last;
};

// Values (s, 6) of a polynomial at the points of an element.
KL_INLINE void at_points(const Residuals& w, int64_t element, int32_t patch, double* out) {
    const double* terms = w.terms + 6 * w.count * int64_t{patch};
    for (int64_t q = 0; q < w.s; ++q, out += 6) {
        double y[3], monomial[TERMS], sum[6] = {};
        local(w.frames + 12 * int64_t{patch}, w.X + 3 * (element * w.s + q), y);
        powers(y, w.degree, monomial);
        for (int i = 0; i < w.count; ++i)
            for (int c = 0; c < 6; ++c) sum[c] += monomial[i] * terms[6 * i + c];
        for (int c = 0; c < 6; ++c) out[c] = sum[c];
    }
}

template <int V>
KL_INLINE void leave_body(const Residuals& w) {
    std::vector<int32_t> met;
    std::vector<double> fitted;  // the polynomials met in an element, at its points
    for (int64_t e = w.first; e < w.last; ++e) {
        met.clear();
        for (int64_t a = 0; a < w.k; ++a) {
            const int32_t node = w.nodes[e * w.k + a], first = w.start[node], last = w.start[node + 1];
            double sum[6] = {};
            for (int64_t q = 0; q < w.s; ++q)
                for (int c = 0; c < 6; ++c) sum[c] += w.E[a * w.s + q] * w.values[6 * (e * w.s + q) + c];
            for (int32_t j = first; j < last; ++j) {
                const size_t known = std::find(met.begin(), met.end(), w.patches[j]) - met.begin();
                if (known == met.size()) {
                    met.push_back(w.patches[j]);
                    if (fitted.size() < 6 * w.s * met.size()) fitted.resize(6 * w.s * met.size());
                    at_points(w, e, w.patches[j], fitted.data() + 6 * w.s * known);
                }
                const double *value = fitted.data() + 6 * w.s * known, share = 1.0 / (last - first);
                for (int64_t q = 0; q < w.s; ++q)
                    for (int c = 0; c < 6; ++c) sum[c] -= share * w.E[a * w.s + q] * value[6 * q + c];
            }
            for (int c = 0; c < 6; ++c) w.out[6 * (e * w.k + a) + c] = sum[c];
        }
    }
}

KL_DISPATCH(leave, leave_body, const Residuals&)

}  // namespace kl
