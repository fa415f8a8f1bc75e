// Strains of elements that do not lock: what they add to the strain of the displacements, V elements at once.
//
// Enhanced modes of the eight-node hexahedron.  Its displacements are a linear field and sum_h m_h (gamma_h u)
// with the products m_h of two and three reference coordinates (Belytschko & Bindeman, CMAME 105 (1993) 225).
// Constant stress has no energy with the modes: they see the second part alone, 12 numbers in place of 24.
// A mode is a covariant strain T_c times a monomial p / j.  With S_c = C T_c
//
//     D = T_c S_c' sum_q w p p' / j,   L = S_c grad(m_h) sum_q w p / j,   K = K(displacements) - L^T D^-1 L,
//
// and D falls apart into one block for each monomial where J is constant.
//
// Projected dilatation.  With d = P^T (dilatation) and M = P^T P of polynomials P, sums over Gauss points, the
// stiffness is that of the points with other moduli, and d^T M^-1 d times a constant stress.

#pragma once
#include "gauss.hpp"

namespace kl {

// Eliminate n unknowns of a symmetric matrix (n, width), upper half and right-hand sides; the diagonal becomes
// that of the inverse of the pivots.
template <int V>
KL_INLINE void eliminate(vec<double, V>* M, int n, int width) {
    for (int p = 0; p < n; ++p) {
        const vec<double, V>* pivot = M + p * width;
        const vec<double, V> inverse = 1.0 / pivot[p];
        for (int i = p + 1; i < n; ++i) {
            const vec<double, V> factor = inverse * pivot[i];
            for (int j = i; j < width; ++j) M[i * width + j] -= factor * pivot[j];
        }
        M[p * width + p] = inverse;
    }
}

// Solve for the one right-hand side (column n) of eliminated rows (n, n + 1).
template <int V>
KL_INLINE void substitute_back(vec<double, V>* M, int n) {
    for (int i = n - 1; i >= 0; --i) {
        vec<double, V>* row = M + i * (n + 1);
        for (int j = i + 1; j < n; ++j) row[n] -= row[j] * M[j * (n + 1) + n];
        row[n] *= row[i];
    }
}

// ---- enhanced modes ---------------------------------------------------------------------------------

constexpr int MONOMIALS = 6, MODES = 21, PRODUCTS = 4;  // ξ η ζ ξη ηζ ζξ; modes; ξη ηζ ζξ ξηζ
constexpr int FIRST_MODE[MONOMIALS + 1] = {0, 3, 6, 9, 13, 17, 21};  // of each monomial
constexpr int COMPONENT[MODES] = {0, 3, 5, 1, 3, 4, 2, 4, 5, 0, 1, 4, 5, 1, 2, 3, 5, 0, 2, 3, 4};
constexpr int MONOMIAL[MODES] = {0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5};

template <int V>
struct Enhanced {
    typedef vec<double, V> Vec;
    bool affine;
    Vec gamma[8][PRODUCTS];
    Vec strain[6][6], stress[6][6], energy[6][6];  // T_c j0, S_c j0, T_c S_c' j0²
    Vec weight[MONOMIALS][MONOMIALS];              // sum w p p' / j
    Vec gradient[MONOMIALS][PRODUCTS][3];          // sum w p grad(m_h)
};

// γ from the reference coordinates of the nodes, 8 dN of the center, and J0^-1.
template <int V>
KL_INLINE void find_gamma(const double* center, const vec<double, V>* X, const vec<double, V> (&inverse)[3][3],
                          vec<double, V> (&gamma)[8][PRODUCTS]) {
    for (int h = 0; h < PRODUCTS; ++h) {
        vec<double, V> moved[3] = {};
        double sign[8];
        for (int a = 0; a < 8; ++a) {
            const double xi[3] = {8 * center[3 * a], 8 * center[3 * a + 1], 8 * center[3 * a + 2]};
            sign[a] = (h < 3 ? xi[h] * xi[(h + 1) % 3] : xi[0] * xi[1] * xi[2]) / 8;
            for (int i = 0; i < 3; ++i) moved[i] += sign[a] * X[3 * a + i];
        }
        for (int a = 0; a < 8; ++a) gamma[a][h] = vec<double, V>{} + sign[a];
        for (int r = 0; r < 3; ++r) {
            const vec<double, V> share =
                inverse[r][0] * moved[0] + inverse[r][1] * moved[1] + inverse[r][2] * moved[2];
            for (int a = 0; a < 8; ++a) gamma[a][h] -= share * center[3 * a + r];
        }
    }
}

// T_c j0 = sym(g_k g_m) j0 in Voigt order, of the rows g of J0^-1.
template <int V>
KL_INLINE void find_strains(const vec<double, V> (&inverse)[3][3], const vec<double, V>& j0,
                            vec<double, V> (&strain)[6][6]) {
    for (int c = 0; c < 6; ++c) {
        const vec<double, V>*g = inverse[c % 3], *h = inverse[c < 3 ? c : (c + 1) % 3];
        for (int i = 0; i < 3; ++i) {
            const int j = (i + 1) % 3;
            strain[c][i] = j0 * (g[i] * h[i]);
            strain[c][3 + i] = j0 * (g[i] * h[j] + g[j] * h[i]);
        }
    }
}

// Everything that does not depend on u, of Jacobians J (g).
template <int V>
KL_INLINE void find_modes(const Elements& w, const vec<double, V>* X, const vec<double, V> (*J)[3][3],
                          Enhanced<V>& m) {
    typedef vec<double, V> Vec;
    Vec J0[3][3], inverse[3][3], j0;
    reference_gradient<V>(X, w.addition.center, w.k, J0);
    invert<V>(J0, inverse, j0);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) inverse[i][j] /= j0;
    find_gamma<V>(w.addition.center, X, inverse, m.gamma);
    find_strains<V>(inverse, j0, m.strain);
    for (int c = 0; c < 6; ++c) elastic<V>(w.addition.law, m.strain[c], m.stress[c]);
    for (int c = 0; c < 6; ++c)
        for (int d = c; d < 6; ++d) {
            Vec sum = {};
            for (int v = 0; v < 6; ++v) sum += m.strain[c][v] * m.stress[d][v];
            m.energy[c][d] = m.energy[d][c] = sum;
        }
    m.affine = w.addition.orthogonal && constant<V>(w.k, w.g, X, &J[0][0][0]);
    for (int p = 0; p < MONOMIALS; ++p) {
        for (int o = 0; o < MONOMIALS; ++o) m.weight[p][o] = Vec{};
        for (int h = 0; h < PRODUCTS; ++h)
            for (int i = 0; i < 3; ++i) m.gradient[p][h][i] = Vec{};
    }
    for (int q = 0; q < w.g; ++q) {
        Vec c[3][3], det, G[PRODUCTS][3];
        invert<V>(J[q], c, det);
        const Vec scale = w.weights[q] / det;
        const double* p = w.addition.functions + MONOMIALS * q;
        for (int i = 0; i < 3; ++i) {
            for (int h = 0; h < 3; ++h)
                G[h][i] = (p[(h + 1) % 3] * c[h][i] + p[h] * c[(h + 1) % 3][i]) * scale;
            G[3][i] = (p[4] * c[0][i] + p[5] * c[1][i] + p[3] * c[2][i]) * scale;
        }
        for (int s = 0; s < MONOMIALS; ++s) {
            for (int o = s; o < MONOMIALS; ++o) m.weight[s][o] += p[s] * p[o] * scale;
            for (int h = 0; h < PRODUCTS; ++h)
                for (int i = 0; i < 3; ++i) m.gradient[s][h][i] += p[s] * G[h][i];
        }
    }
}

// f(first mode, n, rows) for independent modes: rows (n, n + columns) with D and room for right-hand sides.
template <int V, int columns, class F>
KL_INLINE void for_independent(const Enhanced<V>& m, const F& f) {
    vec<double, V> rows[MODES * (MODES + columns)];
    const int blocks = m.affine ? MONOMIALS : 1;
    for (int block = 0; block < blocks; ++block) {
        const int first = m.affine ? FIRST_MODE[block] : 0;
        const int n = (m.affine ? FIRST_MODE[block + 1] : MODES) - first;
        for (int i = 0; i < n; ++i)
            for (int j = i; j < n; ++j) {
                const int a = first + i, b = first + j;
                rows[i * (n + columns) + j] =
                    m.energy[COMPONENT[a]][COMPONENT[b]] * m.weight[MONOMIAL[a]][MONOMIAL[b]];
            }
        f(first, n, rows);
    }
}

// The enhanced strain times j, for each monomial (6, 6), of displacements u.
template <int V>
KL_INLINE void find_enhanced_strain(const Enhanced<V>& m, const vec<double, V>* u, vec<double, V>* strain) {
    typedef vec<double, V> Vec;
    Vec load[MONOMIALS][6], part[PRODUCTS][3] = {};  // gradient of the displacements for each monomial
    for (int h = 0; h < PRODUCTS; ++h)
        for (int a = 0; a < 8; ++a)
            for (int i = 0; i < 3; ++i) part[h][i] += m.gamma[a][h] * u[3 * a + i];
    for (int p = 0; p < MONOMIALS; ++p)
        for (int i = 0; i < 3; ++i) {
            const int j = (i + 1) % 3;
            load[p][i] = load[p][3 + i] = strain[6 * p + i] = strain[6 * p + 3 + i] = Vec{};
            for (int h = 0; h < PRODUCTS; ++h) {
                load[p][i] += part[h][i] * m.gradient[p][h][i];
                load[p][3 + i] += part[h][i] * m.gradient[p][h][j] + part[h][j] * m.gradient[p][h][i];
            }
        }
    for_independent<V, 1>(m, [&](int first, int n, Vec* rows) KL_INLINE_LAMBDA {
        for (int i = 0; i < n; ++i) {
            Vec sum = {};
            for (int c = 0; c < 6; ++c) sum += m.stress[COMPONENT[first + i]][c] * load[MONOMIAL[first + i]][c];
            rows[i * (n + 1) + n] = sum;
        }
        eliminate<V>(rows, n, n + 1);
        substitute_back<V>(rows, n);
        for (int i = 0; i < n; ++i)
            for (int c = 0; c < 6; ++c)
                strain[6 * MONOMIAL[first + i] + c] -=
                    rows[i * (n + 1) + n] * m.strain[COMPONENT[first + i]][c];
    });
}

// ---- projected dilatation ---------------------------------------------------------------------------

// The polynomials at a Gauss point: 1, or 1 and J0^-1 (x - x of the center).
template <int V>
KL_INLINE void polynomials(const Elements& w, const vec<double, V>* X, int q, vec<double, V> (&P)[4]) {
    P[0] = vec<double, V>{} + 1.0;
    if (w.addition.terms == 1) return;
    vec<double, V> J0[3][3], c[3][3], j0, away[3] = {};
    reference_gradient<V>(X, w.addition.center, w.k, J0);
    invert<V>(J0, c, j0);
    const double* N = w.addition.functions + static_cast<int64_t>(w.k) * q;
    for (int a = 0; a < w.k; ++a)
        for (int i = 0; i < 3; ++i) away[i] += N[a] * X[3 * a + i];
    for (int r = 0; r < 3; ++r) P[1 + r] = (c[r][0] * away[0] + c[r][1] * away[1] + c[r][2] * away[2]) / j0;
}

// Replace values at the Gauss points (g) by those of their projection; `room` has 4 g numbers.
template <int V>
KL_INLINE void project(const Elements& w, const vec<double, V>* X, vec<double, V>* values, vec<double, V>* room) {
    typedef vec<double, V> Vec;
    const int n = w.addition.terms;
    Vec rows[20] = {};
    for (int q = 0; q < w.g; ++q) {
        Vec cofactors[3][3], det, P[4];
        jacobian<V>(w, X, q, cofactors, det);
        polynomials<V>(w, X, q, P);
        for (int i = 0; i < n; ++i) {
            const Vec weighted = P[i] * det * w.weights[q];
            for (int j = i; j < n; ++j) rows[i * (n + 1) + j] += weighted * P[j];
            rows[i * (n + 1) + n] += weighted * values[q];
            room[4 * q + i] = P[i];
        }
    }
    eliminate<V>(rows, n, n + 1);
    substitute_back<V>(rows, n);
    for (int q = 0; q < w.g; ++q) {
        values[q] = Vec{};
        for (int i = 0; i < n; ++i) values[q] += room[4 * q + i] * rows[i * (n + 1) + n];
    }
}

}  // namespace kl
