// The kernels over Gauss points for small strains, for elements [first, last) and every instruction set.

#pragma once
#include "condensed.hpp"

namespace kl {

// out (m): 1 where det J is clearly positive at every point, beside the weighted mean of |det J| and
// beside the rounding of coordinates of its size; 0 leaves the judgement to the caller.  So nothing
// is decided here near det J = 0, where rounding would decide.
constexpr double CLEAR_SHARE = 1e-9, CLEAR_ROUNDING = 1e-12;

template <int V>
KL_INLINE void clearly_positive_body(const Elements& w) {
    typedef vec<double, V> Vec;
    Vec* X = reinterpret_cast<Vec*>(w.space);
    for (int64_t e = w.first; e < w.last; e += V) {
        Vec reach, size, mean = {}, lowest = Vec{} + __builtin_inf();
        gather<V>(w, w.points, e, X);
        largest<V>(X, 3 * w.k, reach);
        shift_to_first_node<V>(X, w.k);
        largest<V>(X, 3 * w.k, size);
        for (int q = 0; q < w.g; ++q) {
            Vec cofactors[3][3], det, size_of_det;
            jacobian<V>(w, X, q, cofactors, det);
            lowest = det < lowest ? det : lowest;
            absolute<V>(det, size_of_det);
            mean += w.weights[q] * size_of_det;  // not a number stays so, and is not clear
        }
        const Vec bound = CLEAR_ROUNDING * size * size * (size + reach);
        for (int l = 0; l < V && e + l < w.last; ++l)
            w.out[e + l - w.origin] = lowest[l] > CLEAR_SHARE * mean[l] && lowest[l] > bound[l];
    }
}

// out (m): 1 where every node lies where the combination to_nodes (k, g) of the nodes `base` (g) has it, to
// `near` times the largest coordinate.
template <int V>
KL_INLINE void interpolated_body(const Elements& w) {
    typedef vec<double, V> Vec;
    Vec* X = reinterpret_cast<Vec*>(w.space);
    for (int64_t e = w.first; e < w.last; e += V) {
        Vec reach, size, distance = {};
        gather<V>(w, w.points, e, X);
        largest<V>(X, 3 * w.k, reach);
        shift_to_first_node<V>(X, w.k);
        for (int a = 0; a < w.k; ++a) {
            const double* C = w.to_nodes + static_cast<int64_t>(w.g) * a;
            Vec gap[3] = {X[3 * a], X[3 * a + 1], X[3 * a + 2]};
            for (int b = 0; b < w.g; ++b)
                for (int i = 0; i < 3; ++i) gap[i] -= C[b] * X[3 * w.base[b] + i];
            largest<V>(gap, 3, size);
            distance = size > distance ? size : distance;
        }
        for (int l = 0; l < V && e + l < w.last; ++l)
            w.out[e + l - w.origin] = distance[l] <= w.near * reach[l];
    }
}

// out (m, g): γ det J.
template <int V>
KL_INLINE void volumes_body(const Elements& w) {
    typedef vec<double, V> Vec;
    for (int64_t e = w.first; e < w.last; e += V) {
        const Local<V> at = gather_all<V>(w, e, w.space);
        for (int q = 0; q < w.g; ++q) {
            Vec cofactors[3][3], det;
            jacobian<V>(w, at.X, q, cofactors, det);
            at.rest[q] = det * w.weights[q];
        }
        store<V>(w, at.rest, w.g, e, w.out);
    }
}

// out (m, k): Σ N_a γ det J, the row sums of the mass matrix; second (m, k): its diagonal.
template <int V>
KL_INLINE void row_sums_body(const Elements& w) {
    typedef vec<double, V> Vec;
    for (int64_t e = w.first; e < w.last; e += V) {
        const Local<V> at = gather_all<V>(w, e, w.space);
        Vec *sums = at.rest, *diagonal = sums + w.k;
        for (int a = 0; a < 2 * w.k; ++a) sums[a] = Vec{};
        for (int q = 0; q < w.g; ++q) {
            Vec cofactors[3][3], det;
            jacobian<V>(w, at.X, q, cofactors, det);
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
KL_INLINE void body_force_body(const Elements& w) {
    typedef vec<double, V> Vec;
    for (int64_t e = w.first; e < w.last; e += V) {
        const Local<V> at = gather_all<V>(w, e, w.space);
        Vec* force = at.rest;
        for (int a = 0; a < 3 * w.k; ++a) force[a] = Vec{};
        for (int q = 0; q < w.g; ++q) {
            Vec cofactors[3][3], det, value[3] = {};
            jacobian<V>(w, at.X, q, cofactors, det);
            const double* N = w.N + static_cast<int64_t>(w.k) * q;
            for (int a = 0; a < w.k; ++a)
                for (int i = 0; i < 3; ++i) value[i] += N[a] * at.u[3 * a + i];
            for (int i = 0; i < 3; ++i) value[i] *= det * w.weights[q];
            for (int a = 0; a < w.k; ++a)
                for (int i = 0; i < 3; ++i) force[3 * a + i] += N[a] * value[i];
        }
        store<V>(w, force, 3 * w.k, e, w.out);
    }
}

// What is known at one Gauss point of V elements: volume, J^-1, ε, C ε and C ε + σ0.
template <int V>
struct PointState {
    vec<double, V> dV, inverse[3][3], strain[6], elastic[6], stress[6];
};

// The strains that elements add: of each monomial (6, 6) times det J, or the projected dilatation (g).
template <int V>
KL_INLINE vec<double, V>* added(const Elements& w) {
    return reinterpret_cast<vec<double, V>*>(w.space) + w.added_from();
}

// ε of the displacements, J^-1 and γ det J.
template <int V>
KL_INLINE void evaluate_plain(const Elements& w, const Local<V>& at, int q, PointState<V>& s) {
    vec<double, V> H[3][3];
    inverse_jacobian<V>(w, at.X, q, s.inverse, s.dV);
    gradient<V>(w, at.u, q, s.inverse, H);
    for (int i = 0; i < 3; ++i) {
        s.strain[i] = H[i][i];
        s.strain[3 + i] = H[i][(i + 1) % 3] + H[(i + 1) % 3][i];
    }
}

// Replace a share of the trace of a strain or stress.
template <int V>
KL_INLINE void deviate(double share, const vec<double, V>& trace, vec<double, V>* tensor) {
    const vec<double, V> change = share / 3 * (trace - (tensor[0] + tensor[1] + tensor[2]));
    for (int i = 0; i < 3; ++i) tensor[i] += change;
}

template <int V>
KL_INLINE void evaluate(const Elements& w, const Local<V>& at, int q, PointState<V>& s) {
    evaluate_plain<V>(w, at, q, s);
    if (w.addition.kind == Addition::modes) {
        const vec<double, V> scale = w.weights[q] / s.dV;
        for (int p = 0; p < MONOMIALS; ++p)
            for (int c = 0; c < 6; ++c)
                s.strain[c] += w.addition.functions[MONOMIALS * q + p] * scale * added<V>(w)[6 * p + c];
    } else if (w.addition.kind == Addition::dilatation)
        deviate<V>(w.addition.share, added<V>(w)[q], s.strain);
    elastic<V>(w.law, s.strain, s.elastic);
    for (int c = 0; c < 6; ++c) {
        s.elastic[c] *= at.initial[6];
        s.stress[c] = s.elastic[c] + at.initial[c];
    }
}

// Coordinates, displacements and prestress of V elements; what they add to the strain is found.
template <int V>
KL_INLINE Local<V> gather_strained(const Elements& w, int64_t e) {
    typedef vec<double, V> Vec;
    const Local<V> at = gather_all<V>(w, e, w.space);
    if (w.addition.kind == Addition::modes) {
        auto* J = reinterpret_cast<Vec(*)[3][3]>(added<V>(w) + 36);
        for (int q = 0; q < w.g; ++q) reference_gradient<V>(at.X, w.dN_at(q), w.k, J[q]);
        Enhanced<V> modes;
        find_modes<V>(w, at.X, J, modes);
        find_enhanced_strain<V>(modes, at.u, added<V>(w));
    } else if (w.addition.kind == Addition::dilatation) {
        PointState<V> s;
        for (int q = 0; q < w.g; ++q) {
            evaluate_plain<V>(w, at, q, s);
            added<V>(w)[q] = s.strain[0] + s.strain[1] + s.strain[2];
        }
        project<V>(w, at.X, added<V>(w), added<V>(w) + w.g);
    }
    return at;
}

// (g, 6): C ε + σ0.
template <int V>
KL_INLINE void find_stress(const Elements& w, const Local<V>& at, int64_t e, PointState<V>& s) {
    for (int q = 0; q < w.g; ++q) {
        evaluate<V>(w, at, q, s);
        for (int c = 0; c < 6; ++c) at.rest[6 * q + c] = s.stress[c];
    }
    store<V>(w, at.rest, 6 * w.g, e, w.out);
}

// (k, 3): Σ B^T (C ε + σ0) γ det J.
template <int V>
KL_INLINE void find_internal_load(const Elements& w, const Local<V>& at, int64_t e, PointState<V>& s) {
    typedef vec<double, V> Vec;
    const bool projected = w.addition.kind == Addition::dilatation;  // its transpose projects the stress
    for (int a = 0; a < 3 * w.k; ++a) at.rest[a] = Vec{};
    Vec* trace = at.rest + 3 * w.k;
    for (int q = 0; projected && q < w.g; ++q) {
        evaluate<V>(w, at, q, s);
        trace[q] = s.stress[0] + s.stress[1] + s.stress[2];
    }
    if (projected) project<V>(w, at.X, trace, trace + w.g);
    for (int q = 0; q < w.g; ++q) {
        evaluate<V>(w, at, q, s);
        if (projected) deviate<V>(w.addition.share, trace[q], s.stress);
        for (int c = 0; c < 6; ++c) s.stress[c] *= s.dV;
        Vec T[3][3], R[3][3];
        times_symmetric<V>(s.inverse, s.stress, T);
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) R[i][j] = T[j][i];
        add_forces<V>(w, q, R, at.rest);
    }
    store<V>(w, at.rest, 3 * w.k, e, w.out);
}

// (2): ½ Σ ε C ε γ det J and the largest square of the von Mises stress.
template <int V>
KL_INLINE void find_totals(const Elements& w, const Local<V>& at, int64_t e, PointState<V>& s) {
    typedef vec<double, V> Vec;
    Vec found[2] = {};
    for (int q = 0; q < w.g; ++q) {
        evaluate<V>(w, at, q, s);
        Vec energy = {};
        for (int c = 0; c < 6; ++c) energy += s.strain[c] * s.elastic[c];
        found[0] += 0.5 * energy * s.dV;
        const Vec* t = s.stress;
        const Vec xy = t[0] - t[1], yz = t[1] - t[2], zx = t[2] - t[0];
        const Vec square = 0.5 * (xy * xy + yz * yz + zx * zx) + 3.0 * (t[3] * t[3] + t[4] * t[4] + t[5] * t[5]);
        found[1] = square > found[1] ? square : found[1];
    }
    store<V>(w, found, 2, e, w.out);
}

// (k, 6): C ε + σ0 taken to the nodes; second (6): its mean over the volume.
template <int V>
KL_INLINE void find_averages(const Elements& w, const Local<V>& at, int64_t e, PointState<V>& s) {
    typedef vec<double, V> Vec;
    Vec *stress = at.rest, *nodal = stress + 6 * w.g, mean[6] = {}, volume = {};
    for (int q = 0; q < w.g; ++q) {
        evaluate<V>(w, at, q, s);
        volume += s.dV;
        for (int c = 0; c < 6; ++c) {
            stress[6 * q + c] = s.stress[c];
            mean[c] += s.stress[c] * s.dV;
        }
    }
    for (int c = 0; c < 6; ++c) mean[c] /= volume;
    for (int a = 0; a < w.k; ++a)
        for (int c = 0; c < 6; ++c) {
            Vec sum = {};
            for (int q = 0; q < w.g; ++q) sum += w.to_nodes[static_cast<int64_t>(w.g) * a + q] * stress[6 * q + c];
            nodal[6 * a + c] = sum;
        }
    store<V>(w, nodal, 6 * w.k, e, w.out);
    store<V>(w, mean, 6, e, w.second + 6 * w.origin);
}

enum class Wanted { stress, internal_load, totals, averages };

// out (m, …): what is wanted of the strains of each element. One body for all: most of the code finds the strains.
template <int V>
KL_INLINE void strained_body(const Elements& w, Wanted wanted) {
    PointState<V> s;
    for (int64_t e = w.first; e < w.last; e += V) {
        const Local<V> at = gather_strained<V>(w, e);
        switch (wanted) {
            case Wanted::stress: find_stress<V>(w, at, e, s); break;
            case Wanted::internal_load: find_internal_load<V>(w, at, e, s); break;
            case Wanted::totals: find_totals<V>(w, at, e, s); break;
            case Wanted::averages: find_averages<V>(w, at, e, s); break;
        }
    }
}

inline void over_strains(const Elements& w, Wanted wanted) {
    dispatch<double>([&](auto V) KL_INLINE_LAMBDA { strained_body<V>(w, wanted); });
}

inline void stress(const Elements& w) { over_strains(w, Wanted::stress); }
inline void internal_load(const Elements& w) { over_strains(w, Wanted::internal_load); }
inline void totals(const Elements& w) { over_strains(w, Wanted::totals); }
inline void averages(const Elements& w) { over_strains(w, Wanted::averages); }

KL_DISPATCH(clearly_positive, clearly_positive_body, const Elements&)
KL_DISPATCH(interpolated, interpolated_body, const Elements&)
KL_DISPATCH(volumes, volumes_body, const Elements&)
KL_DISPATCH(row_sums, row_sums_body, const Elements&)
KL_DISPATCH(body_force, body_force_body, const Elements&)

}  // namespace kl
