// The kernels over Gauss points, for elements [first, last) and every instruction set.

#pragma once
#include "gauss.hpp"

namespace kl {

// out (m): 1 where det J is clearly positive at every point, beside the weighted mean of |det J| and
// beside the rounding of coordinates of its size; 0 leaves the judgement to the caller.  So nothing
// is decided here near det J = 0, where rounding would decide.
constexpr double CLEAR_SHARE = 1e-9, CLEAR_ROUNDING = 1e-12;

template <int V>
KL_INLINE void clearly_positive_body(const Gauss& w) {
    typedef vec<double, V> lane;
    lane* X = reinterpret_cast<lane*>(w.space);
    for (int64_t e = w.first; e < w.last; e += V) {
        lane reach, size, mean = {}, lowest = lane{} + __builtin_inf();
        gather<V>(w, w.points, e, X);
        largest<V>(X, 3 * w.k, reach);
        shift_to_first_node<V>(X, w.k);
        largest<V>(X, 3 * w.k, size);
        for (int q = 0; q < w.g; ++q) {
            lane cofactors[3][3], det, size_of_det;
            jacobian<V>(w, X, q, cofactors, det);
            lowest = det < lowest ? det : lowest;
            absolute<V>(det, size_of_det);
            mean += w.weights[q] * size_of_det;  // not a number stays so, and is not clear
        }
        const lane bound = CLEAR_ROUNDING * size * size * (size + reach);
        for (int l = 0; l < V && e + l < w.last; ++l)
            w.out[e + l - w.origin] = lowest[l] > CLEAR_SHARE * mean[l] && lowest[l] > bound[l];
    }
}

// out (m, g): γ det J.
template <int V>
KL_INLINE void volumes_body(const Gauss& w) {
    typedef vec<double, V> lane;
    lane* X = reinterpret_cast<lane*>(w.space);
    lane* dV = X + 3 * w.k;
    for (int64_t e = w.first; e < w.last; e += V) {
        gather_points<V>(w, e, X);
        for (int q = 0; q < w.g; ++q) {
            lane cofactors[3][3], det;
            jacobian<V>(w, X, q, cofactors, det);
            dV[q] = det * w.weights[q];
        }
        store<V>(w, dV, w.g, e, w.out);
    }
}

// out (m, k): Σ N_a γ det J, the row sums of the mass matrix; second (m, k): its diagonal.
template <int V>
KL_INLINE void shares_body(const Gauss& w) {
    typedef vec<double, V> lane;
    lane* X = reinterpret_cast<lane*>(w.space);
    lane *sums = X + 3 * w.k, *diagonal = sums + w.k;
    for (int64_t e = w.first; e < w.last; e += V) {
        gather_points<V>(w, e, X);
        for (int a = 0; a < 2 * w.k; ++a) sums[a] = lane{};
        for (int q = 0; q < w.g; ++q) {
            lane cofactors[3][3], det;
            jacobian<V>(w, X, q, cofactors, det);
            det *= w.weights[q];
            const double* N = w.N + static_cast<int64_t>(w.k) * q;
            for (int a = 0; a < w.k; ++a) {
                sums[a] += N[a] * det;
                diagonal[a] += N[a] * N[a] * det;
            }
        }
        store<V>(w, sums, w.k, e, w.out);
        if (w.second) store<V>(w, diagonal, w.k, e, w.second + w.k * w.origin);
    }
}

// out (m, k, 3): Σ N_a b γ det J of a nodal field b.
template <int V>
KL_INLINE void body_force_body(const Gauss& w) {
    typedef vec<double, V> lane;
    lane* X = reinterpret_cast<lane*>(w.space);
    lane *b = X + 3 * w.k, *force = b + 3 * w.k;
    for (int64_t e = w.first; e < w.last; e += V) {
        gather_points<V>(w, e, X);
        gather<V>(w, w.field, e, b);
        for (int a = 0; a < 3 * w.k; ++a) force[a] = lane{};
        for (int q = 0; q < w.g; ++q) {
            lane cofactors[3][3], det, value[3] = {};
            jacobian<V>(w, X, q, cofactors, det);
            const double* N = w.N + static_cast<int64_t>(w.k) * q;
            for (int a = 0; a < w.k; ++a)
                for (int i = 0; i < 3; ++i) value[i] += N[a] * b[3 * a + i];
            for (int i = 0; i < 3; ++i) value[i] *= det * w.weights[q];
            for (int a = 0; a < w.k; ++a)
                for (int i = 0; i < 3; ++i) force[3 * a + i] += N[a] * value[i];
        }
        store<V>(w, force, 3 * w.k, e, w.out);
    }
}

// out (m, g, 6): C ε + σ0.
template <int V>
KL_INLINE void stress_body(const Gauss& w) {
    typedef vec<double, V> lane;
    lane* X = reinterpret_cast<lane*>(w.space);
    lane *u = X + 3 * w.k, *initial = u + 3 * w.k, *stress = initial + 6;
    State<V> s;
    for (int64_t e = w.first; e < w.last; e += V) {
        gather_points<V>(w, e, X);
        gather<V>(w, w.field, e, u);
        gather_prestress<V>(w, e, initial);
        for (int q = 0; q < w.g; ++q) {
            state_at<V>(w, X, u, q, s);
            for (int c = 0; c < 6; ++c) stress[6 * q + c] = s.elastic[c] + initial[c];
        }
        store<V>(w, stress, 6 * w.g, e, w.out);
    }
}

// out (m, k, 3): Σ B^T (C ε + σ0) γ det J.
template <int V>
KL_INLINE void internal_load_body(const Gauss& w) {
    typedef vec<double, V> lane;
    lane* X = reinterpret_cast<lane*>(w.space);
    lane *u = X + 3 * w.k, *initial = u + 3 * w.k, *force = initial + 6;
    State<V> s;
    for (int64_t e = w.first; e < w.last; e += V) {
        gather_points<V>(w, e, X);
        gather<V>(w, w.field, e, u);
        gather_prestress<V>(w, e, initial);
        for (int a = 0; a < 3 * w.k; ++a) force[a] = lane{};
        for (int q = 0; q < w.g; ++q) {
            state_at<V>(w, X, u, q, s);
            lane t[6], P[3][3];  // P = σ J^-T γ det J, so that forces need the reference gradients alone
            for (int c = 0; c < 6; ++c) t[c] = (s.elastic[c] + initial[c]) * s.dV;
            for (int j = 0; j < 3; ++j) {
                P[0][j] = t[0] * s.inverse[j][0] + t[3] * s.inverse[j][1] + t[5] * s.inverse[j][2];
                P[1][j] = t[3] * s.inverse[j][0] + t[1] * s.inverse[j][1] + t[4] * s.inverse[j][2];
                P[2][j] = t[5] * s.inverse[j][0] + t[4] * s.inverse[j][1] + t[2] * s.inverse[j][2];
            }
            const double* dN = w.dN + 3 * static_cast<int64_t>(w.k) * q;
            for (int a = 0; a < w.k; ++a)
                for (int i = 0; i < 3; ++i)
                    force[3 * a + i] +=
                        P[i][0] * dN[3 * a] + P[i][1] * dN[3 * a + 1] + P[i][2] * dN[3 * a + 2];
        }
        store<V>(w, force, 3 * w.k, e, w.out);
    }
}

// out (m, 2): ½ Σ ε C ε γ det J and the largest square of the von Mises stress.
template <int V>
KL_INLINE void totals_body(const Gauss& w) {
    typedef vec<double, V> lane;
    lane* X = reinterpret_cast<lane*>(w.space);
    lane *u = X + 3 * w.k, *initial = u + 3 * w.k, *found = initial + 6;
    State<V> s;
    for (int64_t e = w.first; e < w.last; e += V) {
        gather_points<V>(w, e, X);
        gather<V>(w, w.field, e, u);
        gather_prestress<V>(w, e, initial);
        found[0] = found[1] = lane{};
        for (int q = 0; q < w.g; ++q) {
            state_at<V>(w, X, u, q, s);
            lane t[6], energy = {};
            for (int c = 0; c < 6; ++c) {
                energy += s.strain[c] * s.elastic[c];
                t[c] = s.elastic[c] + initial[c];
            }
            found[0] += 0.5 * energy * s.dV;
            const lane xy = t[0] - t[1], yz = t[1] - t[2], zx = t[2] - t[0];
            const lane square =
                0.5 * (xy * xy + yz * yz + zx * zx) + 3.0 * (t[3] * t[3] + t[4] * t[4] + t[5] * t[5]);
            found[1] = square > found[1] ? square : found[1];
        }
        store<V>(w, found, 2, e, w.out);
    }
}

// out (m, k, 6): C ε + σ0 taken to the nodes; second (m, 6): its mean over the volume.
template <int V>
KL_INLINE void averages_body(const Gauss& w) {
    typedef vec<double, V> lane;
    lane* X = reinterpret_cast<lane*>(w.space);
    lane *u = X + 3 * w.k, *initial = u + 3 * w.k, *mean = initial + 6, *stress = mean + 6;
    lane* nodal = stress + 6 * w.g;
    State<V> s;
    for (int64_t e = w.first; e < w.last; e += V) {
        gather_points<V>(w, e, X);
        gather<V>(w, w.field, e, u);
        gather_prestress<V>(w, e, initial);
        lane volume = {};
        for (int c = 0; c < 6; ++c) mean[c] = lane{};
        for (int q = 0; q < w.g; ++q) {
            state_at<V>(w, X, u, q, s);
            volume += s.dV;
            for (int c = 0; c < 6; ++c) {
                stress[6 * q + c] = s.elastic[c] + initial[c];
                mean[c] += stress[6 * q + c] * s.dV;
            }
        }
        for (int c = 0; c < 6; ++c) mean[c] /= volume;
        for (int a = 0; a < w.k; ++a)
            for (int c = 0; c < 6; ++c) {
                lane sum = {};
                for (int q = 0; q < w.g; ++q)
                    sum += w.to_nodes[static_cast<int64_t>(w.g) * a + q] * stress[6 * q + c];
                nodal[6 * a + c] = sum;
            }
        store<V>(w, nodal, 6 * w.k, e, w.out);
        store<V>(w, mean, 6, e, w.second + 6 * w.origin);
    }
}

KL_DISPATCH(clearly_positive, clearly_positive_body, double, const Gauss&)
KL_DISPATCH(volumes, volumes_body, double, const Gauss&)
KL_DISPATCH(shares, shares_body, double, const Gauss&)
KL_DISPATCH(body_force, body_force_body, double, const Gauss&)
KL_DISPATCH(stress, stress_body, double, const Gauss&)
KL_DISPATCH(internal_load, internal_load_body, double, const Gauss&)
KL_DISPATCH(totals, totals_body, double, const Gauss&)
KL_DISPATCH(averages, averages_body, double, const Gauss&)

}  // namespace kl
