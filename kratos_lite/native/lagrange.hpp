// Large displacements, V elements at once: load, energy and stiffness of the total Lagrangian form.
//
// With F = 1 + dq/dX, S = C:E + S0 and P = F S, a step from q to q + dq takes F in its middle and the
// mean of both stresses; E+ - E is computed from the increment, never as a difference.

#pragma once
#include <cmath>
#include <cstdint>

#include "gauss.hpp"
#include "stiffness.hpp"

namespace kl {

// C (6, 6), as two constants where it is isotropic to the last bits.
struct Law {
    const double* C = nullptr;
    bool isotropic = true;

    Law() = default;
    explicit Law(const double* C) : C(C) {
        double size = 0;
        for (int i = 0; i < 36; ++i) size = std::fmax(size, std::fabs(C[i]));
        for (int i = 0; i < 6; ++i)
            for (int j = 0; j < 6; ++j) {
                const double shear = i < 3 ? 2 * C[21] : C[21];
                const double ideal = (i < 3 && j < 3 ? C[1] : 0) + (i == j ? shear : 0);
                isotropic &= std::fabs(C[6 * i + j] - ideal) <= 4e-16 * size;
            }
    }
};

// Elements and their displacements; `increment` (n, 3) is null without a step.
struct Displaced : Gauss {
    const double* increment;
    double damping;
    Law law;

    double rate_of_F() const { return increment ? 0.5 : 1.0; }
    double rate_of_S() const { return increment ? 0.5 + damping : 1.0; }
};

// What is known at one Gauss point: P = F S, and δE = sym(end^T δF).
template <int V>
struct Motion {
    vec<double, V> dV, inverse[3][3], F[3][3], end[3][3], E[6], S[6];
};

template <int V>
KL_INLINE void elastic(const Law& law, const vec<double, V>* E, vec<double, V>* S) {
    if (law.isotropic) {
        const vec<double, V> pressure = law.C[1] * (E[0] + E[1] + E[2]);
        const double mu = law.C[21];
        for (int i = 0; i < 3; ++i) {
            S[i] = pressure + 2 * mu * E[i];
            S[3 + i] = mu * E[3 + i];
        }
        return;
    }
    for (int c = 0; c < 6; ++c) {
        vec<double, V> sum = {};
        for (int d = 0; d < 6; ++d) sum += law.C[6 * c + d] * E[d];
        S[c] = sum;
    }
}

// dq_i/dX_j
template <int V>
KL_INLINE void gradient(const Gauss& w, const vec<double, V>* q, int point,
                        const vec<double, V> (&inverse)[3][3], vec<double, V> (&H)[3][3]) {
    vec<double, V> R[3][3];
    reference_gradient<V>(q, w.dN + 3 * static_cast<int64_t>(w.k) * point, w.k, R);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            H[i][j] = R[i][0] * inverse[0][j] + R[i][1] * inverse[1][j] + R[i][2] * inverse[2][j];
}

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

// Coordinates, displacements, increments and prestress of V elements.
template <int V>
struct Gathered {
    vec<double, V>*X, *q, *dq, *initial, *rest;
};

template <int V>
KL_INLINE Gathered<V> gather_all(const Displaced& w, int64_t e, double* space) {
    vec<double, V>* X = reinterpret_cast<vec<double, V>*>(space);
    Gathered<V> found{X, X + 3 * w.k, X + 6 * w.k, X + 9 * w.k, X + 9 * w.k + 6};
    gather_points<V>(w, e, found.X);
    gather<V>(w, w.field, e, found.q);
    if (w.increment) gather<V>(w, w.increment, e, found.dq);
    gather_prestress<V>(w, e, found.initial);
    return found;
}

template <int V>
KL_INLINE void move(const Displaced& w, const Gathered<V>& at, int point, Motion<V>& m) {
    vec<double, V> det, H[3][3], change[6];
    jacobian<V>(w, at.X, point, m.inverse, det);
    const vec<double, V> share = 1.0 / det;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) m.inverse[i][j] *= share;
    m.dV = det * w.weights[point];
    gradient<V>(w, at.q, point, m.inverse, H);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) m.F[i][j] = 0.5 * H[i][j] + (i == j ? 1.0 : 0.0);
    strain_change<V>(m.F, H, m.E);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) m.end[i][j] = m.F[i][j] = m.F[i][j] + 0.5 * H[i][j];
    if (w.increment) {
        gradient<V>(w, at.dq, point, m.inverse, H);
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) {
                m.F[i][j] += 0.5 * H[i][j];
                m.end[i][j] += H[i][j];
            }
        strain_change<V>(m.F, H, change);
        for (int c = 0; c < 6; ++c) m.E[c] += w.rate_of_S() * change[c];
    }
    elastic<V>(w.law, m.E, m.S);
    for (int c = 0; c < 6; ++c) m.S[c] += at.initial[c];
}

// T = A S of a symmetric S in Voigt order.
template <int V>
KL_INLINE void times_symmetric(const vec<double, V> (&A)[3][3], const vec<double, V>* S,
                               vec<double, V> (&T)[3][3]) {
    for (int i = 0; i < 3; ++i) {
        T[i][0] = A[i][0] * S[0] + A[i][1] * S[3] + A[i][2] * S[5];
        T[i][1] = A[i][0] * S[3] + A[i][1] * S[1] + A[i][2] * S[4];
        T[i][2] = A[i][0] * S[5] + A[i][1] * S[4] + A[i][2] * S[2];
    }
}

// out (m, k, 3): ∫ P grad N dV.
template <int V>
KL_INLINE void load_body(const Displaced& w) {
    typedef vec<double, V> lane;
    Motion<V> m;
    for (int64_t e = w.first; e < w.last; e += V) {
        const Gathered<V> at = gather_all<V>(w, e, w.space);
        lane* force = at.rest;
        for (int a = 0; a < 3 * w.k; ++a) force[a] = lane{};
        for (int q = 0; q < w.g; ++q) {
            move<V>(w, at, q, m);
            lane P[3][3], R[3][3];  // R = P J^-T γ det J, so that forces need the reference gradients alone
            times_symmetric<V>(m.F, m.S, P);
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    R[i][j] = m.dV * (P[i][0] * m.inverse[j][0] + P[i][1] * m.inverse[j][1] +
                                      P[i][2] * m.inverse[j][2]);
            const double* dN = w.dN + 3 * static_cast<int64_t>(w.k) * q;
            for (int a = 0; a < w.k; ++a)
                for (int i = 0; i < 3; ++i)
                    force[3 * a + i] += R[i][0] * dN[3 * a] + R[i][1] * dN[3 * a + 1] + R[i][2] * dN[3 * a + 2];
        }
        store<V>(w, force, 3 * w.k, e, w.out);
    }
}

// out (m, 2): ∫ (½ E:C:E + S0:E) dV and the largest E:E.
template <int V>
KL_INLINE void totals_body(const Displaced& w) {
    typedef vec<double, V> lane;
    Motion<V> m;
    for (int64_t e = w.first; e < w.last; e += V) {
        const Gathered<V> at = gather_all<V>(w, e, w.space);
        lane found[2] = {};
        for (int q = 0; q < w.g; ++q) {
            move<V>(w, at, q, m);
            lane energy = {};
            for (int c = 0; c < 6; ++c) energy += 0.5 * m.E[c] * (m.S[c] + at.initial[c]);
            found[0] += energy * m.dV;
            const lane square = m.E[0] * m.E[0] + m.E[1] * m.E[1] + m.E[2] * m.E[2] +
                                0.5 * (m.E[3] * m.E[3] + m.E[4] * m.E[4] + m.E[5] * m.E[5]);
            found[1] = square > found[1] ? square : found[1];
        }
        store<V>(w, found, 2, e, w.out);
    }
}

KL_DISPATCH(load_some, load_body, double, const Displaced&)
KL_DISPATCH(totals_some, totals_body, double, const Displaced&)

// ---- stiffness -------------------------------------------------------------------------------------

struct TangentTask : Group {  // with tangent_size() numbers of work
    const Displaced& w;
    double* data;
};

// Numbers that one task needs: what it gathers, the gradients and motions, and Z of one node.
inline int64_t tangent_size(const Gauss& w, int V) {
    const int64_t motion = sizeof(Motion<2>) / sizeof(vec<double, 2>);
    return V * (9 * w.k + 6 + w.g * (3 * w.k + motion + 27));
}

// Z[i][j][s] with K_ab[i][j] = Σ Z_a[i][j][s] dN_b/dX_s over the points: the stress that the gradient g
// of node a takes from δE, and the initial stress.
template <int V>
KL_INLINE void row_at(const Displaced& w, const Motion<V>& m, const vec<double, V>* g, vec<double, V>* Z) {
    typedef vec<double, V> lane;
    lane T[3][3], Sg[3];
    for (int i = 0; i < 3; ++i) {
        lane E[6], S[6];
        for (int r = 0; r < 3; ++r) {
            const int s = (r + 1) % 3;
            E[r] = w.rate_of_S() * (m.dV * (m.F[i][r] * g[r]));
            E[3 + r] = w.rate_of_S() * (m.dV * (m.F[i][r] * g[s] + m.F[i][s] * g[r]));
        }
        elastic<V>(w.law, E, S);
        times_symmetric<V>(m.end, S, T);
        for (int j = 0; j < 3; ++j)
            for (int s = 0; s < 3; ++s) Z[9 * i + 3 * j + s] = T[j][s];
    }
    const lane share = w.rate_of_F() * m.dV;
    Sg[0] = share * (m.S[0] * g[0] + m.S[3] * g[1] + m.S[5] * g[2]);
    Sg[1] = share * (m.S[3] * g[0] + m.S[1] * g[1] + m.S[4] * g[2]);
    Sg[2] = share * (m.S[5] * g[0] + m.S[4] * g[1] + m.S[2] * g[2]);
    for (int i = 0; i < 3; ++i)
        for (int s = 0; s < 3; ++s) Z[12 * i + s] += Sg[s];
}

// Add the block of the nodes a, b, and its mirror image where that is the block of b, a.
template <int V>
KL_INLINE void add_row_times(const TangentTask& t, int a, int b, const vec<double, V>* Z,
                             const vec<double, V>* gradients) {
    const int k = t.w.k;
    vec<double, V> K[9] = {};
    for (int q = 0; q < t.w.g; ++q, Z += 27) {
        const vec<double, V>* g = gradients + 3 * (q * k + b);
        for (int c = 0; c < 9; ++c) K[c] += Z[3 * c] * g[0] + Z[3 * c + 1] * g[1] + Z[3 * c + 2] * g[2];
    }
    add_blocks<V>(t.data, t.place + a * k + b, k * k, t.ahead, K);
    if (t.w.increment || a == b) return;
    const vec<double, V> mirror[9] = {K[0], K[3], K[6], K[1], K[4], K[7], K[2], K[5], K[8]};
    add_blocks<V>(t.data, t.place + b * k + a, k * k, t.ahead, mirror);
}

template <int V>
KL_INLINE void tangent_body(const TangentTask& t) {
    typedef vec<double, V> lane;
    const Displaced& w = t.w;
    const int k = w.k;
    const Gathered<V> at = gather_all<V>(w, t.first, t.work);
    lane* gradients = at.rest;
    auto* motions = reinterpret_cast<Motion<V>*>(gradients + 3 * w.g * k);
    lane* Z = reinterpret_cast<lane*>(motions + w.g);
    for (int q = 0; q < w.g; ++q) {
        move<V>(w, at, q, motions[q]);
        const auto& inverse = motions[q].inverse;
        const double* dN = w.dN + 3 * static_cast<int64_t>(k) * q;
        for (int a = 0; a < k; ++a)
            for (int j = 0; j < 3; ++j)
                gradients[3 * (q * k + a) + j] =
                    dN[3 * a] * inverse[0][j] + dN[3 * a + 1] * inverse[1][j] + dN[3 * a + 2] * inverse[2][j];
    }
    for (int a = 0; a < k; ++a) {
        for (int q = 0; q < w.g; ++q) row_at<V>(w, motions[q], gradients + 3 * (q * k + a), Z + 27 * q);
        for (int b = w.increment ? 0 : a; b < k; ++b) add_row_times<V>(t, a, b, Z, gradients);
    }
}
KL_DISPATCH(add_tangent_group, tangent_body, double, const TangentTask&)

}  // namespace kl
