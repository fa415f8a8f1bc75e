// The stiffness of V elements at once times a vector.
//
// From nodal values u come the gradients R = du/dxi at the Gauss points of V elements at once, from these
// H = R J^-1, the stress C sym(H), and F = stress J^-T w det J; the forces of node a are sum_q F dN_a.
// In single precision, for smoothing, J^-1 and w det J are kept; where J is constant, once for all points.
// In double precision they are found anew from the coordinates, which takes less time than to read them.

#pragma once
#include "gauss.hpp"
#include "sum_factorization.hpp"

namespace kl {

// Elements that share tables and material.
struct ProductGroup {
    Elements w;
    std::vector<float> dN;        // (g, k, 3)
    int64_t first = 0;            // of the element vectors, counted in nodes
    int width = 0;                // elements that share a place in `geometry`, one in each lane
    std::vector<int64_t> start;   // of each of these places
    std::vector<float> geometry;  // (places, 1 or g, 10, width): J^-1 and det J
    double lambda = 0, mu = 0;
    TensorTables<float> tensor32;
    TensorTables<double> tensor64;

    bool affine(int64_t e) const { return start[e / width + 1] - start[e / width] == 10 * width; }
    int64_t places() const { return (w.last + width - 1) / width; }
};

// Columns 0 … 2 of four rows.
template <class T>
KL_INLINE void transpose_rows(const vec<T, 4> (&r)[4], vec<T, 4> (&c)[3]) {
    vec<T, 4> low[2], high[2];
    for (int h = 0; h < 2; ++h) {
        pick<T, 4, 0, 4, 1, 5>(low[h], r[2 * h], r[2 * h + 1]);
        pick<T, 4, 2, 6, 3, 7>(high[h], r[2 * h], r[2 * h + 1]);
    }
    pick<T, 4, 0, 1, 4, 5>(c[0], low[0], low[1]);
    pick<T, 4, 2, 3, 6, 7>(c[1], low[0], low[1]);
    pick<T, 4, 0, 1, 4, 5>(c[2], high[0], high[1]);
}

// Four rows of three columns and one of zeros.
template <class T>
KL_INLINE void transpose_columns(const vec<T, 4> (&c)[3], vec<T, 4> (&r)[4]) {
    const vec<T, 4> zero = {};
    vec<T, 4> low[2], high[2];
    pick<T, 4, 0, 4, 1, 5>(low[0], c[0], c[1]);
    pick<T, 4, 2, 6, 3, 7>(high[0], c[0], c[1]);
    pick<T, 4, 0, 4, 1, 5>(low[1], c[2], zero);
    pick<T, 4, 2, 6, 3, 7>(high[1], c[2], zero);
    pick<T, 4, 0, 1, 4, 5>(r[0], low[0], low[1]);
    pick<T, 4, 2, 3, 6, 7>(r[1], low[0], low[1]);
    pick<T, 4, 0, 1, 4, 5>(r[2], high[0], high[1]);
    pick<T, 4, 2, 3, 6, 7>(r[3], high[0], high[1]);
}

// Values x (n, 3) at the nodes of V elements; a number behind the last of x is read, but not used.
template <class T, int V>
KL_INLINE void gather_nodal(const ProductGroup& s, const T* x, int64_t e, vec<T, V>* to) {
    T* flat = reinterpret_cast<T*>(to);
    const int k = s.w.k;
    constexpr int W = V % 4 ? 1 : 4;
    for (int lane = 0; lane < V; lane += W) {
        const int32_t* nodes[W];
        for (int l = 0; l < W; ++l) nodes[l] = s.w.nodes + std::min(e + lane + l, s.w.last - 1) * k;
        for (int a = 0; a < k; ++a) {
            if constexpr (W == 4) {
                vec<T, 4> rows[4], columns[3];
                for (int l = 0; l < 4; ++l)
                    rows[l] = *reinterpret_cast<const vec<T, 4>*>(x + 3 * static_cast<int64_t>(nodes[l][a]));
                transpose_rows<T>(rows, columns);
                for (int i = 0; i < 3; ++i) *reinterpret_cast<vec<T, 4>*>(flat + (3 * a + i) * V + lane) = columns[i];
            } else {
                for (int i = 0; i < 3; ++i) flat[(3 * a + i) * V + lane] = x[3 * static_cast<int64_t>(nodes[0][a]) + i];
            }
        }
    }
}

// Element vectors (k, 4) of V elements, of which the fourth numbers are not used.
template <class T, int V>
KL_INLINE void store_nodal(const vec<T, V>* from, int k, int64_t lanes, T* out) {
    const T* flat = reinterpret_cast<const T*>(from);
    if constexpr (V % 4 == 0) {
        if (lanes == V) {
            for (int lane = 0; lane < V; lane += 4, out += 16 * k)
                for (int a = 0; a < k; ++a) {
                    vec<T, 4> rows[4], columns[3];
                    for (int i = 0; i < 3; ++i)
                        columns[i] = *reinterpret_cast<const vec<T, 4>*>(flat + (3 * a + i) * V + lane);
                    transpose_columns<T>(columns, rows);
                    for (int l = 0; l < 4; ++l) *reinterpret_cast<vec<T, 4>*>(out + 4 * (l * k + a)) = rows[l];
                }
            return;
        }
    }
    for (int64_t lane = 0; lane < lanes; ++lane)
        for (int a = 0; a < k; ++a)
            for (int i = 0; i < 3; ++i) out[4 * (lane * k + a) + i] = flat[(3 * a + i) * V + lane];
}

// R_ij = sum_a u_ai dN_aj
template <class T, int V>
KL_INLINE void reference_gradient_of(const vec<T, V>* u, const T* dN, int k, vec<T, V> (&R)[3][3]) {
    vec<T, V> sum[3][3] = {};
    for (int a = 0; a < k; ++a, u += 3, dN += 3)
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) sum[i][j] += u[i] * dN[j];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) R[i][j] = sum[i][j];
}

// F = C sym(R G) G^T dV with G = J^-1.
template <class T, int V>
KL_INLINE void stress_forces(const ProductGroup& s, const vec<T, V> (&R)[3][3], const vec<T, V>* G, const vec<T, V>& dV,
                             vec<T, V>* F) {
    typedef vec<T, V> Vec;
    Vec H[3][3], S[3][3];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) H[i][j] = R[i][0] * G[j] + R[i][1] * G[3 + j] + R[i][2] * G[6 + j];
    if (s.w.law.isotropic) {
        const Vec mu = static_cast<T>(s.mu) * dV, pressure = static_cast<T>(s.lambda) * dV * (H[0][0] + H[1][1] + H[2][2]);
        for (int i = 0; i < 3; ++i) {
            const int j = (i + 1) % 3;
            S[i][i] = pressure + (mu + mu) * H[i][i];
            S[i][j] = S[j][i] = mu * (H[i][j] + H[j][i]);
        }
    } else {
        const Vec E[6] = {H[0][0], H[1][1], H[2][2], H[0][1] + H[1][0], H[1][2] + H[2][1], H[2][0] + H[0][2]};
        Vec v[6];
        for (int c = 0; c < 6; ++c) {
            Vec sum = {};
            for (int d = 0; d < 6; ++d) sum += static_cast<T>(s.w.law.C[6 * c + d]) * E[d];
            v[c] = sum * dV;
        }
        for (int i = 0; i < 3; ++i) {
            S[i][i] = v[i];
            S[i][(i + 1) % 3] = S[(i + 1) % 3][i] = v[3 + i];
        }
    }
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) F[3 * i + j] = S[i][0] * G[3 * j] + S[i][1] * G[3 * j + 1] + S[i][2] * G[3 * j + 2];
}

template <class T>
KL_INLINE const TensorTables<T>& tensor(const ProductGroup& s) {
    if constexpr (std::is_same_v<T, float>) return s.tensor32;
    else return s.tensor64;
}

// Forces of `count` nodes from `a` on; together they use each F that is loaded.
template <class T, int V, int count>
KL_INLINE void sum_forces(const vec<T, V>* F, const T* dN, int k, int g, int a, vec<T, V>* f) {
    vec<T, V> sum[count][3] = {};
    for (int q = 0; q < g; ++q) {
        const T* at = dN + 3 * (q * static_cast<int64_t>(k) + a);
        vec<T, V> at_point[9];
        for (int c = 0; c < 9; ++c) at_point[c] = F[c * g + q];
        for (int n = 0; n < count; ++n)
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j) sum[n][i] += at_point[3 * i + j] * at[3 * n + j];
    }
    for (int n = 0; n < count; ++n)
        for (int i = 0; i < 3; ++i) f[3 * (a + n) + i] = sum[n][i];
}

// J^-1 and det J of elements with nodes at X.
template <int V>
KL_INLINE void find_geometry(const ProductGroup& s, const vec<double, V>* X, int q, vec<double, V> (&G)[10]) {
    vec<double, V> J[3][3], c[3][3];
    reference_gradient_of<double, V>(X, s.w.dN_at(q), s.w.k, J);
    invert<V>(J, c, G[9]);
    for (int e = 0; e < 9; ++e) G[e] = c[e / 3][e % 3] / G[9];
}

template <class T>
const T* table(const ProductGroup& s) {
    if constexpr (std::is_same_v<T, float>) return s.dN.data();
    else return s.w.dN;
}

// Gradients (3, 3, g) of u (k, 3) at the Gauss points.
template <class T, int V>
KL_INLINE void gradients(const ProductGroup& s, const vec<T, V>* u, vec<T, V>* out) {
    const int k = s.w.k, g = s.w.g;
    if (tensor<T>(s).n == 2) return tensor_gradients<T, V, 2>(tensor<T>(s), u, out);
    if (tensor<T>(s).n == 3) return tensor_gradients<T, V, 3>(tensor<T>(s), u, out);
    for (int q = 0; q < g; ++q) {
        vec<T, V> R[3][3];
        reference_gradient_of<T, V>(u, table<T>(s) + 3 * static_cast<int64_t>(k) * q, k, R);
        for (int c = 0; c < 9; ++c) out[c * g + q] = R[c / 3][c % 3];
    }
}

// The same at the first point alone.
template <int V>
KL_INLINE void first_gradient(const ProductGroup& s, const vec<double, V>* X, vec<double, V>* out) {
    vec<double, V> R[3][3];
    reference_gradient_of<double, V>(X, s.w.dN, s.w.k, R);
    for (int c = 0; c < 9; ++c) out[c * s.w.g] = R[c / 3][c % 3];
}

// The transpose: nodal forces f (k, 3) of F (3, 3, g).
template <class T, int V>
KL_INLINE void forces(const ProductGroup& s, const vec<T, V>* F, vec<T, V>* f) {
    const int k = s.w.k;
    if (tensor<T>(s).n == 2) return tensor_forces<T, V, 2>(tensor<T>(s), F, f);
    if (tensor<T>(s).n == 3) return tensor_forces<T, V, 3>(tensor<T>(s), F, f);
    int a = 0;
    for (; a + 3 <= k; a += 3) sum_forces<T, V, 3>(F, table<T>(s), k, s.w.g, a, f);
    for (; a < k; ++a) sum_forces<T, V, 1>(F, table<T>(s), k, s.w.g, a, f);
}

// J^-1 and det J at a point of V elements: from the gradients of the coordinates, or as they are kept.
template <int V>
KL_INLINE void geometry_at(const ProductGroup& s, int64_t, const vec<double, V>* J, int q, vec<double, V> (&G)[10]) {
    vec<double, V> at[3][3], c[3][3];
    for (int e = 0; e < 9; ++e) at[e / 3][e % 3] = J[e * s.w.g + q];
    invert<V>(at, c, G[9]);
    for (int e = 0; e < 9; ++e) G[e] = c[e / 3][e % 3] / G[9];
}

template <int V>
KL_INLINE void geometry_at(const ProductGroup& s, int64_t e, const vec<float, V>*, int q, vec<float, V> (&G)[10]) {
    const float* kept = s.geometry.data() + s.start[e / s.width] + 10 * V * q;
    for (int c = 0; c < 10; ++c) G[c] = *reinterpret_cast<const vec<float, V>*>(kept + c * V);
}

// Element vectors (last - first, k, 4).
template <class T, int V>
KL_INLINE void element_forces(const ProductGroup& s, const T* x, T* out, int64_t first, int64_t last, vec<T, V>* space) {
    typedef vec<T, V> Vec;
    const int k = s.w.k, g = s.w.g;
    Vec *u = space, *F = u + 3 * k, *X = F + 9 * g, *J = X + 3 * k;
    for (int64_t e = first; e < last; e += V) {
        const bool affine = s.affine(e);
        if constexpr (std::is_same_v<T, double>) {
            gather_nodal<T, V>(s, s.w.points, e, X);
            shift_to_first_node<V>(X, k);
            affine ? first_gradient<V>(s, X, J) : gradients<T, V>(s, X, J);
        }
        gather_nodal<T, V>(s, x, e, u);
        gradients<T, V>(s, u, F);
        Vec G[10] = {}, R[3][3], S[9];
        for (int q = 0; q < g; ++q) {
            if (q == 0 || !affine) geometry_at<V>(s, e, J, q, G);
            for (int c = 0; c < 9; ++c) R[c / 3][c % 3] = F[c * g + q];
            stress_forces<T, V>(s, R, G, G[9] * static_cast<T>(s.w.weights[q]), S);
            for (int c = 0; c < 9; ++c) F[c * g + q] = S[c];
        }
        forces<T, V>(s, F, u);
        store_nodal<T, V>(u, k, std::min<int64_t>(V, last - e), out + (e - first) * 4 * k);
    }
}

// Add to K (6), as xx yy zz xy yz zx, the share of a Gauss point in the diagonal block of a node.
template <int V>
KL_INLINE void add_diagonal(const ProductGroup& s, const double* dN, const vec<double, V> (&G)[10],
                            const vec<double, V>& dV, vec<double, V>* K) {
    typedef vec<double, V> Vec;
    if (s.w.law.isotropic) {
        Vec D[3];
        for (int j = 0; j < 3; ++j) D[j] = dN[0] * G[j] + dN[1] * G[3 + j] + dN[2] * G[6 + j];
        const Vec both = (s.lambda + s.mu) * dV, trace = s.mu * dV * (D[0] * D[0] + D[1] * D[1] + D[2] * D[2]);
        for (int i = 0; i < 3; ++i) {
            K[i] += both * D[i] * D[i] + trace;
            K[3 + i] += both * D[i] * D[(i + 1) % 3];
        }
        return;
    }
    for (int i = 0; i < 3; ++i) {  // forces of a unit displacement along i
        Vec R[3][3] = {}, F[9];
        for (int j = 0; j < 3; ++j) R[i][j] += dN[j];
        stress_forces<double, V>(s, R, G, dV, F);
        const int next = (i + 1) % 3;
        for (int j = 0; j < 3; ++j) {
            K[i] += F[3 * i + j] * dN[j];
            K[3 + i] += F[3 * next + j] * dN[j];
        }
    }
}

// Diagonal blocks (m, k, 6) of elements [first, last).
template <int V>
KL_INLINE void element_diagonals(const ProductGroup& s, double* out, int64_t first, int64_t last, vec<double, V>* space) {
    const int k = s.w.k;
    vec<double, V> *X = space, *K = X + 3 * k, G[10];
    for (int64_t e = first; e < last; e += V) {
        gather_nodal<double, V>(s, s.w.points, e, X);
        shift_to_first_node<V>(X, k);
        for (int c = 0; c < 6 * k; ++c) K[c] = vec<double, V>{};
        for (int q = 0; q < s.w.g; ++q) {
            find_geometry<V>(s, X, q, G);
            for (int a = 0; a < k; ++a)
                add_diagonal<V>(s, s.w.dN_at(q) + 3 * a, G, G[9] * s.w.weights[q], K + 6 * a);
        }
        const double* flat = reinterpret_cast<const double*>(K);
        const int64_t lanes = std::min<int64_t>(V, last - e);
        for (int64_t lane = 0; lane < lanes; ++lane)
            for (int c = 0; c < 6 * k; ++c) out[(e + lane) * 6 * k + c] = flat[c * V + lane];
    }
}

// J^-1 and det J of the elements of some places, (1 or g, 10, width) each.
template <int V>
KL_INLINE void store_geometry(ProductGroup& s, int64_t first, int64_t last, vec<double, V>* X) {
    for (int64_t e = first * s.width; e < last * s.width; e += V) {
        gather_nodal<double, V>(s, s.w.points, e, X);
        shift_to_first_node<V>(X, s.w.k);
        float* to = s.geometry.data() + s.start[e / s.width] + e % s.width;
        const int points = s.affine(e) ? 1 : s.w.g;
        for (int q = 0; q < points; ++q, to += 10 * s.width) {
            vec<double, V> G[10];
            find_geometry<V>(s, X, q, G);
            for (int c = 0; c < 10; ++c)
                for (int lane = 0; lane < V; ++lane) to[c * s.width + lane] = static_cast<float>(G[c][lane]);
        }
    }
}

// Whether J is constant in all elements of a place.
template <int V>
KL_INLINE bool is_affine(const ProductGroup& s, int64_t place, vec<double, V>* X) {
    vec<double, V>(*J)[3][3] = reinterpret_cast<vec<double, V>(*)[3][3]>(X + 3 * s.w.k);
    for (int64_t e = place * s.width; e < (place + 1) * s.width; e += V) {
        gather_nodal<double, V>(s, s.w.points, e, X);
        for (int q = 0; q < s.w.g; ++q) reference_gradient_of<double, V>(X, s.w.dN_at(q), s.w.k, J[q]);
        if (!constant<V>(s.w.k, s.w.g, X, &J[0][0][0])) return false;
    }
    return true;
}

}  // namespace kl
