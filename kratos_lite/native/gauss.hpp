// Loops over Gauss points: geometry, strains, stresses and nodal vectors of elements of any shape.
//
// An element is known by its reference tables alone.  V elements are computed at once, one in each
// lane, so that a kernel needs no special case for a number of nodes or points.  Coordinates are
// taken from the first node of each element: far from the origin no digits are lost.

#pragma once
#include <cstdint>

#include "isa.hpp"

namespace kl {

// Some elements [first, last), their tables, and what a kernel reads and writes.
struct Gauss {
    const double* points;     // (n, 3)
    const int32_t* nodes;     // (m, k)
    int k, g;                 // nodes of an element, points of its rule
    const double* N;          // (g, k)
    const double* dN;         // (g, k, 3)
    const double* weights;    // (g)
    const double* field;      // (n, 3) displacement or force per volume
    const double* C;          // (6, 6)
    const double* prestress;  // (m, 6) or null
    const double* to_nodes;   // (k, g) extrapolation
    double* space;            // of `vectors()` vectors
    double* out;              // result of the kernel, a row for each element from `origin`
    double* second;           // second result, rows of all elements, or null
    int64_t origin, first, last;

    // Vectors of working space: coordinates, displacements, prestress, stresses, nodal values.
    int64_t vectors() const { return 12 * static_cast<int64_t>(k) + 12 + 6 * static_cast<int64_t>(g); }
};

// Rows (k, 3) of a nodal field in lanes; spare lanes repeat the last element.
template <int V>
KL_INLINE void gather(const Gauss& w, const double* values, int64_t e, vec<double, V>* to) {
    double* flat = reinterpret_cast<double*>(to);
    for (int lane = 0; lane < V; ++lane) {
        const int32_t* nodes = w.nodes + (e + lane < w.last ? e + lane : w.last - 1) * w.k;
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

template <int V>
KL_INLINE void gather_points(const Gauss& w, int64_t e, vec<double, V>* X) {
    gather<V>(w, w.points, e, X);
    shift_to_first_node<V>(X, w.k);
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
KL_INLINE void jacobian(const Gauss& w, const vec<double, V>* X, int q, vec<double, V> (&cofactors)[3][3],
                        vec<double, V>& det) {
    vec<double, V> J[3][3];
    reference_gradient<V>(X, w.dN + 3 * static_cast<int64_t>(w.k) * q, w.k, J);
    invert<V>(J, cofactors, det);
}

// Strain in Voigt order xx yy zz xy yz zx with engineering shear; inverse = J^-1.
template <int V>
KL_INLINE void strain_at(const Gauss& w, const vec<double, V>* u, int q,
                         const vec<double, V> (&inverse)[3][3], vec<double, V> (&strain)[6]) {
    vec<double, V> H[3][3], D[3][3];
    reference_gradient<V>(u, w.dN + 3 * static_cast<int64_t>(w.k) * q, w.k, H);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            D[i][j] = H[i][0] * inverse[0][j] + H[i][1] * inverse[1][j] + H[i][2] * inverse[2][j];
    for (int i = 0; i < 3; ++i) {
        strain[i] = D[i][i];
        strain[3 + i] = D[i][(i + 1) % 3] + D[(i + 1) % 3][i];
    }
}

// What is known at one Gauss point of V elements: volume, J^-1, strain and C ε.
template <int V>
struct State {
    vec<double, V> dV, inverse[3][3], strain[6], elastic[6];
};

template <int V>
KL_INLINE void state_at(const Gauss& w, const vec<double, V>* X, const vec<double, V>* u, int q,
                        State<V>& s) {
    vec<double, V> det;
    jacobian<V>(w, X, q, s.inverse, det);
    const vec<double, V> share = 1.0 / det;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) s.inverse[i][j] *= share;
    s.dV = det * w.weights[q];
    strain_at<V>(w, u, q, s.inverse, s.strain);
    for (int c = 0; c < 6; ++c) {
        vec<double, V> sum = {};
        for (int d = 0; d < 6; ++d) sum += w.C[6 * c + d] * s.strain[d];
        s.elastic[c] = sum;
    }
}

template <int V>
KL_INLINE void gather_prestress(const Gauss& w, int64_t e, vec<double, V>* to) {
    for (int c = 0; c < 6; ++c) {
        to[c] = vec<double, V>{};
        if (!w.prestress) continue;
        for (int lane = 0; lane < V; ++lane)
            to[c][lane] = w.prestress[6 * (e + lane < w.last ? e + lane : w.last - 1) + c];
    }
}

// Lanes [count] of vectors to rows of an array (m, count).
template <int V>
KL_INLINE void store(const Gauss& w, const vec<double, V>* from, int64_t count, int64_t e, double* to) {
    const double* flat = reinterpret_cast<const double*>(from);
    const int64_t lanes = e + V < w.last ? V : w.last - e;
    for (int64_t lane = 0; lane < lanes; ++lane)
        for (int64_t c = 0; c < count; ++c) to[(e + lane - w.origin) * count + c] = flat[c * V + lane];
}

}  // namespace kl
