// Large displacements, V elements at once: load, energy and stiffness of the total Lagrangian formulation.
//
// With F = 1 + du/dX, S = C:E + S0 and P = F S, a step from u to u + du takes F in its middle and the
// mean of both stresses; E+ - E is computed from the increment, never as a difference.

#pragma once
#include "assembly.hpp"
#include "gauss.hpp"

namespace kl {

inline double rate_of_F(const Elements& w) { return w.increment ? 0.5 : 1.0; }
inline double rate_of_S(const Elements& w) { return w.increment ? 0.5 + w.damping : 1.0; }

// What is known at one Gauss point: P = F S, and δE = sym(end^T δF).
template <int V>
struct Deformation {
    vec<double, V> dV, inverse[3][3], F[3][3], end[3][3], E[6], S[6];
};

// E of F + dF less E of F: the symmetric part of middle^T dF, with engineering shear.
template <int V>
KL_INLINE void strain_change(const vec<double, V> (&middle)[3][3], const vec<double, V> (&dF)[3][3],
                             vec<double, V> (&E)[6]) {
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3;
        E[i] = E[3 + i] = vec<double, V>{};
        for (int r = 0; r < 3; ++r) {
            E[i] += middle[r][i] * dF[r][i];
            E[3 + i] += middle[r][i] * dF[r][j] + middle[r][j] * dF[r][i];
        }
    }
}

template <int V>
KL_INLINE void evaluate(const Elements& w, const Local<V>& at, int point, Deformation<V>& m) {
    vec<double, V> H[3][3], change[6];
    inverse_jacobian<V>(w, at.X, point, m.inverse, m.dV);
    gradient<V>(w, at.u, point, m.inverse, H);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) m.F[i][j] = 0.5 * H[i][j] + (i == j ? 1.0 : 0.0);
    strain_change<V>(m.F, H, m.E);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) m.end[i][j] = m.F[i][j] = m.F[i][j] + 0.5 * H[i][j];
    if (w.increment) {
        gradient<V>(w, at.du, point, m.inverse, H);
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) {
                m.F[i][j] += 0.5 * H[i][j];
                m.end[i][j] += H[i][j];
            }
        strain_change<V>(m.F, H, change);
        for (int c = 0; c < 6; ++c) m.E[c] += rate_of_S(w) * change[c];
    }
    elastic<V>(w.law, m.E, m.S);
    for (int c = 0; c < 6; ++c) m.S[c] += at.initial[c];
}

// out (m, k, 3): ∫ P grad N dV.
template <int V>
KL_INLINE void load_body(const Elements& w) {
    typedef vec<double, V> Vec;
    Deformation<V> m;
    for (int64_t e = w.first; e < w.last; e += V) {
        const Local<V> at = gather_all<V>(w, e, w.space);
        for (int a = 0; a < 3 * w.k; ++a) at.rest[a] = Vec{};
        for (int q = 0; q < w.g; ++q) {
            evaluate<V>(w, at, q, m);
            Vec P[3][3], R[3][3];
            times_symmetric<V>(m.F, m.S, P);
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    R[i][j] = m.dV * (P[i][0] * m.inverse[j][0] + P[i][1] * m.inverse[j][1] +
                                      P[i][2] * m.inverse[j][2]);
            add_forces<V>(w, q, R, at.rest);
        }
        store<V>(w, at.rest, 3 * w.k, e, w.out);
    }
}

// out (m, 2): ∫ (½ E:C:E + S0:E) dV and the largest E:E.
template <int V>
KL_INLINE void lagrange_totals_body(const Elements& w) {
    typedef vec<double, V> Vec;
    Deformation<V> m;
    for (int64_t e = w.first; e < w.last; e += V) {
        const Local<V> at = gather_all<V>(w, e, w.space);
        Vec found[2] = {};
        for (int q = 0; q < w.g; ++q) {
            evaluate<V>(w, at, q, m);
            Vec energy = {};
            for (int c = 0; c < 6; ++c) energy += 0.5 * m.E[c] * (m.S[c] + at.initial[c]);
            found[0] += energy * m.dV;
            const Vec square = m.E[0] * m.E[0] + m.E[1] * m.E[1] + m.E[2] * m.E[2] +
                                0.5 * (m.E[3] * m.E[3] + m.E[4] * m.E[4] + m.E[5] * m.E[5]);
            found[1] = square > found[1] ? square : found[1];
        }
        store<V>(w, found, 2, e, w.out);
    }
}

KL_DISPATCH(lagrange_load, load_body, const Elements&)
KL_DISPATCH(lagrange_totals, lagrange_totals_body, const Elements&)

// Numbers that one chunk needs: what it gathers, the gradients and deformations, and Z of one node.
inline int64_t tangent_size(const Elements& w, int V) {
    const int64_t deformation = sizeof(Deformation<2>) / sizeof(vec<double, 2>);
    return V * (9 * w.k + 7 + w.g * (3 * w.k + deformation + 27));
}

// Z[i][j][s] with K_ab[i][j] = Σ Z_a[i][j][s] dN_b/dX_s over the points: the stress that the gradient g
// of node a takes from δE, and the initial stress.
template <int V>
KL_INLINE void row_at(const Elements& w, const Deformation<V>& m, const vec<double, V>* g, vec<double, V>* Z) {
    typedef vec<double, V> Vec;
    Vec T[3][3], Sg[3];
    for (int i = 0; i < 3; ++i) {
        Vec E[6], S[6];
        for (int r = 0; r < 3; ++r) {
            const int s = (r + 1) % 3;
            E[r] = rate_of_S(w) * (m.dV * (m.F[i][r] * g[r]));
            E[3 + r] = rate_of_S(w) * (m.dV * (m.F[i][r] * g[s] + m.F[i][s] * g[r]));
        }
        elastic<V>(w.law, E, S);
        times_symmetric<V>(m.end, S, T);
        for (int j = 0; j < 3; ++j)
            for (int s = 0; s < 3; ++s) Z[9 * i + 3 * j + s] = T[j][s];
    }
    const Vec scale = rate_of_F(w) * m.dV;
    Sg[0] = scale * (m.S[0] * g[0] + m.S[3] * g[1] + m.S[5] * g[2]);
    Sg[1] = scale * (m.S[3] * g[0] + m.S[1] * g[1] + m.S[4] * g[2]);
    Sg[2] = scale * (m.S[5] * g[0] + m.S[4] * g[1] + m.S[2] * g[2]);
    for (int i = 0; i < 3; ++i)
        for (int s = 0; s < 3; ++s) Z[12 * i + s] += Sg[s];
}

// Add the tangent stiffness of V elements; it is symmetric without a step.
template <int V>
KL_INLINE void add_tangent(const Elements& w, const Chunk& chunk, double* data) {
    typedef vec<double, V> Vec;
    const int k = w.k, g = w.g;
    const bool symmetric = !w.increment;
    const Local<V> at = gather_all<V>(w, chunk.first, chunk.work);
    Vec* gradients = at.rest;
    auto* deformations = reinterpret_cast<Deformation<V>*>(gradients + 3 * g * k);
    Vec* Z = reinterpret_cast<Vec*>(deformations + g);
    for (int q = 0; q < g; ++q) {
        evaluate<V>(w, at, q, deformations[q]);
        const auto& inverse = deformations[q].inverse;
        const double* dN = w.dN_at(q);
        for (int a = 0; a < k; ++a)
            for (int j = 0; j < 3; ++j)
                gradients[3 * (q * k + a) + j] =
                    dN[3 * a] * inverse[0][j] + dN[3 * a + 1] * inverse[1][j] + dN[3 * a + 2] * inverse[2][j];
    }
    for (int a = 0; a < k; ++a) {
        for (int q = 0; q < g; ++q) row_at<V>(w, deformations[q], gradients + 3 * (q * k + a), Z + 27 * q);
        for (int b = symmetric ? a : 0; b < k; ++b) {
            Vec K[9] = {};
            const Vec* z = Z;
            for (int q = 0; q < g; ++q, z += 27) {
                const Vec* D = gradients + 3 * (q * k + b);
                for (int c = 0; c < 9; ++c) K[c] += z[3 * c] * D[0] + z[3 * c + 1] * D[1] + z[3 * c + 2] * D[2];
            }
            add_pair<V>(data, chunk, k, a, b, symmetric, K);
        }
    }
}

}  // namespace kl
