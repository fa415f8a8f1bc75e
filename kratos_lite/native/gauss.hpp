// Loops over Gauss points: geometry, strains and stresses of elements of any shape.
//
// An element is known by its reference tables alone.  V elements are computed at once, one in each
// lane of a vector, so that a kernel needs no special case for a number of nodes or points.  Coordinates
// are taken from the first node of each element: far from the origin no digits are lost.

#pragma once
#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstdint>

#include "isa.hpp"

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

// What a class of elements adds to the strain of the displacements; see condensed.hpp.
struct Addition {
    enum Kind { nothing, modes, dilatation };
    Kind kind = nothing;
    const double* center = nullptr;     // (k, 3) dN at the center
    const double* functions = nullptr;  // (g, 6) monomials, or (g, k) N less N at the center
    Law law;                            // of the material
    int terms = 0;                      // polynomials of the dilatation, 1 or 4
    double share = 0;                   // of the dilatation that is projected
    bool orthogonal = true;             // whether the rule has sum w p p' = 0 of different monomials
};

struct LawValues;  // of a law; see constitutive.hpp

// Some elements [first, last), their tables, and what a kernel reads and writes.
struct Elements {
    const double* points;     // (n, 3)
    int64_t n;
    const int32_t* nodes;     // (m, k)
    int k, g;                 // nodes of an element, points of its rule
    const double* N;          // (g, k)
    const double* dN;         // (g, k, 3)
    const double* weights;    // (g)
    const double* field;      // (n, 3) displacement or force per volume, or null
    const double* increment;  // (n, 3) of the displacement in a step, or null
    double damping;           // fraction of the stress increment that is added to the mean stress
    Law law;
    Addition addition;
    const double* prestress;  // (m, 6 or 7) or null; the last is a factor of C
    int initial;              // columns of the prestress
    const double* to_nodes;   // (k, g) extrapolation, or combination of the nodes `base`
    const int32_t* base;      // (g) nodes of an element, or null
    double near;              // share of the largest coordinate that a node may be away
    const LawValues* given;       // what a law has given at Gauss points, or null
    double* space;            // of `vectors()` vectors
    double* out;              // result of the kernel, a row for each element from `origin`
    double* second;           // second result, rows of all elements, or null
    int64_t origin, first, last;

    // Vectors of working space: coordinates, displacements, prestress, stresses, nodal values, added strains.
    int64_t vectors() const { return added_from() + (addition.kind ? 36 + 9 * static_cast<int64_t>(g) : 0); }
    int64_t added_from() const { return 15 * static_cast<int64_t>(k) + 13 + 6 * static_cast<int64_t>(g); }
    const double* dN_at(int q) const { return dN + 3 * static_cast<int64_t>(k) * q; }
};

// Rows (k, 3) of a nodal field, one element in each lane; spare lanes repeat the last element.
template <int V>
KL_INLINE void gather(const Elements& w, const double* values, int64_t e, vec<double, V>* to) {
    double* flat = reinterpret_cast<double*>(to);
    for (int lane = 0; lane < V; ++lane) {
        const int32_t* nodes = w.nodes + std::min(e + lane, w.last - 1) * w.k;
        for (int a = 0; a < w.k; ++a)
            for (int i = 0; i < 3; ++i)
                flat[(3 * a + i) * V + lane] = values[3 * static_cast<int64_t>(nodes[a]) + i];
    }
}

template <int V>
KL_INLINE void shift_to_first_node(vec<double, V>* X, int k) {
    for (int a = k - 1; a >= 0; --a)
        for (int i = 0; i < 3; ++i) X[3 * a + i] -= X[i];
}

// Coordinates, nodal field, increments, prestress with a factor of C, and the space behind them.
template <int V>
struct Local {
    vec<double, V>*X, *u, *du, *initial, *rest;
};

template <int V>
KL_INLINE Local<V> gather_all(const Elements& w, int64_t e, double* space) {
    vec<double, V>* X = reinterpret_cast<vec<double, V>*>(space);
    Local<V> at{X, X + 3 * w.k, X + 6 * w.k, X + 9 * w.k, X + 9 * w.k + 7};
    gather<V>(w, w.points, e, X);
    shift_to_first_node<V>(X, w.k);
    if (w.field) gather<V>(w, w.field, e, at.u);
    if (w.increment) gather<V>(w, w.increment, e, at.du);
    for (int c = 0; c < 7; ++c) {
        at.initial[c] = vec<double, V>{} + (c < 6 ? 0.0 : 1.0);
        for (int lane = 0; c < w.initial && lane < V; ++lane)
            at.initial[c][lane] = w.prestress[w.initial * std::min(e + lane, w.last - 1) + c];
    }
    return at;
}

// Lanes [count] of vectors to rows of an array (m, count).
template <int V>
KL_INLINE void store(const Elements& w, const vec<double, V>* from, int64_t count, int64_t e, double* to) {
    const double* flat = reinterpret_cast<const double*>(from);
    const int64_t lanes = e + V < w.last ? V : w.last - e;
    for (int64_t lane = 0; lane < lanes; ++lane)
        for (int64_t c = 0; c < count; ++c) to[(e + lane - w.origin) * count + c] = flat[c * V + lane];
}

template <int V>
KL_INLINE void absolute(const vec<double, V>& x, vec<double, V>& out) { out = x < 0.0 ? -x : x; }

// Largest absolute value of `count` vectors, lane by lane.
template <int V>
KL_INLINE void largest(const vec<double, V>* values, int count, vec<double, V>& out) {
    out = vec<double, V>{};
    for (int i = 0; i < count; ++i) {
        vec<double, V> size;
        absolute<V>(values[i], size);
        out = size > out ? size : out;
    }
}

constexpr double FAR_ROUNDING = 1e-12;  // of coordinates far away, beside the size of an element, that is neglected

// Whether J differs between Gauss points by no more than the rounding of the coordinates X.
template <int V>
KL_INLINE bool constant(int k, int g, const vec<double, V>* X, const vec<double, V>* J) {
    vec<double, V> reach, size = {}, change = {};
    largest<V>(X, 3 * k, reach);
    for (int c = 3; c < 3 * k; ++c) {
        vec<double, V> x;
        absolute<V>(X[c] - X[c % 3], x);
        size = x > size ? x : size;
    }
    size *= FAR_ROUNDING / (8 * DBL_EPSILON);
    size = reach < size ? reach : size;
    for (int q = 1; q < g; ++q)
        for (int c = 0; c < 9; ++c) {
            vec<double, V> x;
            absolute<V>(J[9 * q + c] - J[c], x);
            change = x > change ? x : change;
        }
    for (int l = 0; l < V; ++l)
        if (!(change[l] <= 8 * DBL_EPSILON * size[l])) return false;
    return true;
}

// d field_i / d xi_j
template <int V>
KL_INLINE void reference_gradient(const vec<double, V>* field, const double* dN, int k,
                                  vec<double, V> (&out)[3][3]) {
    vec<double, V> sum[3][3] = {};
    for (int a = 0; a < k; ++a)
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) sum[i][j] += field[3 * a + i] * dN[3 * a + j];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) out[i][j] = sum[i][j];
}

// cofactors = det(J) J^-1
template <int V>
KL_INLINE void invert(const vec<double, V> (&J)[3][3], vec<double, V> (&cofactors)[3][3],
                      vec<double, V>& det) {
    for (int i = 0; i < 3; ++i) {
        const int b = (i + 1) % 3, c = (i + 2) % 3;
        for (int j = 0; j < 3; ++j) {
            const int p = (j + 1) % 3, q = (j + 2) % 3;
            cofactors[j][i] = J[b][p] * J[c][q] - J[b][q] * J[c][p];
        }
    }
    det = J[0][0] * cofactors[0][0] + J[0][1] * cofactors[1][0] + J[0][2] * cofactors[2][0];
}

template <int V>
KL_INLINE void jacobian(const Elements& w, const vec<double, V>* X, int q, vec<double, V> (&cofactors)[3][3],
                        vec<double, V>& det) {
    vec<double, V> J[3][3];
    reference_gradient<V>(X, w.dN_at(q), w.k, J);
    invert<V>(J, cofactors, det);
}

// J^-1 and γ det J.
template <int V>
KL_INLINE void inverse_jacobian(const Elements& w, const vec<double, V>* X, int q,
                                vec<double, V> (&inverse)[3][3], vec<double, V>& dV) {
    vec<double, V> det;
    jacobian<V>(w, X, q, inverse, det);
    const vec<double, V> scale = 1.0 / det;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) inverse[i][j] *= scale;
    dV = det * w.weights[q];
}

// H_ij = du_i/dX_j
template <int V>
KL_INLINE void gradient(const Elements& w, const vec<double, V>* u, int q,
                        const vec<double, V> (&inverse)[3][3], vec<double, V> (&H)[3][3]) {
    vec<double, V> R[3][3];
    reference_gradient<V>(u, w.dN_at(q), w.k, R);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            H[i][j] = R[i][0] * inverse[0][j] + R[i][1] * inverse[1][j] + R[i][2] * inverse[2][j];
}

// S = C E
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

// force (k, 3) += R dN, where R is a stress times J^-T γ det J: forces need the reference gradients alone.
template <int V>
KL_INLINE void add_forces(const Elements& w, int q, const vec<double, V> (&R)[3][3], vec<double, V>* force) {
    const double* dN = w.dN_at(q);
    for (int a = 0; a < w.k; ++a)
        for (int i = 0; i < 3; ++i)
            force[3 * a + i] += R[i][0] * dN[3 * a] + R[i][1] * dN[3 * a + 1] + R[i][2] * dN[3 * a + 2];
}

}  // namespace kl
