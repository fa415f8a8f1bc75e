// Any constitutive law, V elements at once: Green's strain, and internal force and stiffness of stresses and
// tangents that a law has given at the Gauss points.
//
// Small strains are those of F = 1.  Elements with a dilatation of their own (B-bar) have a strain of
// m^T (B u + 3 delta . u) / 3 more, where delta (k, 3) is known at each point and m = (1, 1, 1, 0, 0, 0).

#pragma once
#include "assembly.hpp"
#include "lagrange.hpp"

namespace kl {

// What a law has given at the Gauss points of m elements.
struct LawValues {
    const double* stress = nullptr;   // (m, g, 6)
    const double* tangent = nullptr;  // (m, g, 6, 6)
    const double* delta = nullptr;    // (m, g, k, 3) or null
    bool finite = false, symmetric = true;
};

// Numbers [offset, offset + count) of the rows of an array (m, total), one element in each lane.
template <int V>
KL_INLINE void load(const Elements& w, const double* from, int64_t total, int64_t offset, int count, int64_t e,
                    vec<double, V>* to) {
    double* flat = reinterpret_cast<double*>(to);
    for (int lane = 0; lane < V; ++lane) {
        const double* row = from + std::min(e + lane, w.last - 1) * total + offset;
        for (int c = 0; c < count; ++c) flat[c * V + lane] = row[c];
    }
}

template <int V>
KL_INLINE void unit(vec<double, V> (&F)[3][3]) {
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) F[i][j] = vec<double, V>{} + (i == j ? 1.0 : 0.0);
}

// F = 1 + H, and J^-1 and γ det J of the place; F = 1 of small strains.
template <int V>
KL_INLINE void deformed(const Elements& w, const Local<V>& at, bool finite, int q, vec<double, V> (&inverse)[3][3],
                        vec<double, V>& dV, vec<double, V> (&F)[3][3]) {
    inverse_jacobian<V>(w, at.X, q, inverse, dV);
    if (!finite) return unit<V>(F);
    gradient<V>(w, at.u, q, inverse, F);
    for (int i = 0; i < 3; ++i) F[i][i] += 1.0;
}

// out (m, g, 7): Green's strain and det F.
template <int V>
KL_INLINE void green_body(const Elements& w) {
    typedef vec<double, V> Vec;
    for (int64_t e = w.first; e < w.last; e += V) {
        const Local<V> at = gather_all<V>(w, e, w.space);
        const int64_t lanes = std::min<int64_t>(V, w.last - e);
        for (int q = 0; q < w.g; ++q) {
            Vec inverse[3][3], cofactors[3][3], H[3][3], middle[3][3], found[7], dV;
            inverse_jacobian<V>(w, at.X, q, inverse, dV);
            gradient<V>(w, at.u, q, inverse, H);
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j) middle[i][j] = 0.5 * H[i][j] + (i == j ? 1.0 : 0.0);
            Vec E[6];
            strain_change<V>(middle, H, E);
            for (int c = 0; c < 6; ++c) found[c] = E[c];
            for (int i = 0; i < 3; ++i) H[i][i] += 1.0;
            invert<V>(H, cofactors, found[6]);
            const double* flat = reinterpret_cast<const double*>(found);
            for (int64_t lane = 0; lane < lanes; ++lane)
                for (int c = 0; c < 7; ++c) w.out[((e + lane - w.origin) * w.g + q) * 7 + c] = flat[c * V + lane];
        }
    }
}

// out (m, k, 3): ∫ B^T σ dV of given stresses.
template <int V>
KL_INLINE void given_load_body(const Elements& w) {
    typedef vec<double, V> Vec;
    const LawValues& given = *w.given;
    for (int64_t e = w.first; e < w.last; e += V) {
        const Local<V> at = gather_all<V>(w, e, w.space);
        Vec* delta = at.rest + 3 * w.k;
        for (int a = 0; a < 3 * w.k; ++a) at.rest[a] = Vec{};
        for (int q = 0; q < w.g; ++q) {
            Vec inverse[3][3], F[3][3], P[3][3], R[3][3], S[6], dV;
            deformed<V>(w, at, given.finite, q, inverse, dV, F);
            load<V>(w, given.stress, 6 * w.g, 6 * q, 6, e, S);
            times_symmetric<V>(F, S, P);
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    R[i][j] = dV * (P[i][0] * inverse[j][0] + P[i][1] * inverse[j][1] + P[i][2] * inverse[j][2]);
            add_forces<V>(w, q, R, at.rest);
            if (!given.delta) continue;
            load<V>(w, given.delta, 3 * w.k * w.g, 3 * w.k * q, 3 * w.k, e, delta);
            const Vec pressure = dV * (S[0] + S[1] + S[2]);
            for (int a = 0; a < 3 * w.k; ++a) at.rest[a] += pressure * delta[a];
        }
        store<V>(w, at.rest, 3 * w.k, e, w.out);
    }
}

KL_DISPATCH(green_strain, green_body, const Elements&)
KL_DISPATCH(given_load, given_load_body, const Elements&)

// What is known at one Gauss point of V elements, and the row Z of one node.
template <int V>
struct GivenPoint {
    vec<double, V> dV, F[3][3], S[6], D[36], Z[27], z[3];
};

inline int64_t given_size(const Elements& w, int V) {
    const int64_t point = sizeof(GivenPoint<2>) / sizeof(vec<double, 2>);
    return V * (9 * w.k + 7 + w.g * (6 * w.k + point));
}

// Z[i][j][s] and z[i] with K_ab[i][j] = Σ Z_a[i][j][s] dN_b/dX_s + z_a[i] delta_b[j] over the points.
template <int V>
KL_INLINE void given_row(const LawValues& given, GivenPoint<V>& m, const vec<double, V>* g, const vec<double, V>* delta) {
    typedef vec<double, V> Vec;
    for (int i = 0; i < 3; ++i) {
        Vec E[6], y[6], T[3][3];
        for (int r = 0; r < 3; ++r) {
            const int s = (r + 1) % 3;
            E[r] = m.dV * (m.F[i][r] * g[r]);
            E[3 + r] = m.dV * (m.F[i][r] * g[s] + m.F[i][s] * g[r]);
        }
        if (given.delta)
            for (int r = 0; r < 3; ++r) E[r] += m.dV * delta[i];
        for (int c = 0; c < 6; ++c) {
            Vec sum = {};
            for (int d = 0; d < 6; ++d) sum += m.D[6 * d + c] * E[d];
            y[c] = sum;
        }
        times_symmetric<V>(m.F, y, T);
        for (int j = 0; j < 3; ++j)
            for (int s = 0; s < 3; ++s) m.Z[9 * i + 3 * j + s] = T[j][s];
        m.z[i] = y[0] + y[1] + y[2];
    }
    if (!given.finite) return;
    const Vec Sg[3] = {m.S[0] * g[0] + m.S[3] * g[1] + m.S[5] * g[2], m.S[3] * g[0] + m.S[1] * g[1] + m.S[4] * g[2],
                       m.S[5] * g[0] + m.S[4] * g[1] + m.S[2] * g[2]};
    for (int i = 0; i < 3; ++i)
        for (int s = 0; s < 3; ++s) m.Z[12 * i + s] += m.dV * Sg[s];
}

// Add the stiffness of V elements.
template <int V>
KL_INLINE void add_given(const Elements& w, const Chunk& chunk, double* data) {
    typedef vec<double, V> Vec;
    const int k = w.k, g = w.g;
    const LawValues& given = *w.given;
    const Local<V> at = gather_all<V>(w, chunk.first, chunk.work);
    Vec *gradients = at.rest, *delta = gradients + 3 * g * k;
    auto* points = reinterpret_cast<GivenPoint<V>*>(delta + 3 * g * k);
    for (int q = 0; q < g; ++q) {
        GivenPoint<V>& m = points[q];
        Vec inverse[3][3];
        deformed<V>(w, at, given.finite, q, inverse, m.dV, m.F);
        load<V>(w, given.stress, 6 * g, 6 * q, 6, chunk.first, m.S);
        load<V>(w, given.tangent, 36 * g, 36 * q, 36, chunk.first, m.D);
        if (given.delta) load<V>(w, given.delta, 3 * k * g, 3 * k * q, 3 * k, chunk.first, delta + 3 * k * q);
        const double* dN = w.dN_at(q);
        for (int a = 0; a < k; ++a)
            for (int j = 0; j < 3; ++j)
                gradients[3 * (q * k + a) + j] =
                    dN[3 * a] * inverse[0][j] + dN[3 * a + 1] * inverse[1][j] + dN[3 * a + 2] * inverse[2][j];
    }
    for (int a = 0; a < k; ++a) {
        for (int q = 0; q < g; ++q)
            given_row<V>(given, points[q], gradients + 3 * (q * k + a), delta + 3 * (q * k + a));
        for (int b = given.symmetric ? a : 0; b < k; ++b) {
            Vec K[9] = {};
            for (int q = 0; q < g; ++q) {
                const Vec *D = gradients + 3 * (q * k + b), *z = points[q].Z;
                for (int c = 0; c < 9; ++c) K[c] += z[3 * c] * D[0] + z[3 * c + 1] * D[1] + z[3 * c + 2] * D[2];
                if (!given.delta) continue;
                const Vec* d = delta + 3 * (q * k + b);
                for (int c = 0; c < 9; ++c) K[c] += points[q].z[c / 3] * d[c % 3];
            }
            add_pair<V>(data, chunk, k, a, b, given.symmetric, K);
        }
    }
}

}  // namespace kl
