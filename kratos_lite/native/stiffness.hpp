// Element stiffness, V elements at once, added to the global matrix as soon as it is there.
//
// With D = dN/dX and P_ab = sum_g w D_a D_b^T the block of the nodes a, b is
//
//     K_ab = lambda P_ab + mu P_ab^T + mu tr(P_ab) I        of an isotropic material,
//     K_ab[i][j] = sum_kl C[ik][jl] P_ab[k][l]              of any material.
//
// D is dN times the cofactors of J, so that the weight is w / det J.  Where J is the same at all Gauss
// points, P_ab = cof^T R_ab cof / det J with the products R_ab = sum_g w dN_a dN_b^T of the reference cell.

#pragma once
#include <algorithm>
#include <atomic>
#include <cfloat>
#include <cstdint>
#include <vector>

#include "isa.hpp"
#include "places.hpp"

namespace kl {

struct Moduli {
    bool isotropic;
    double lambda, mu;
    double tensor[9][9];  // [ij][kl]
};

// The tables of the reference cell: dN (g, k, 3), weights (g), and the products R (pairs, 9).
struct Tables {
    const double* dN;
    const double* weights;
    int g, k;
    std::vector<double> products;
    bool affine_pays() const {
        const int pairs = k * (k + 1) / 2;
        return pairs * 54 + 9 * g * k < 0.8 * (pairs * 9 * g + 18 * g * k);
    }
};

struct Task : Group {  // with work_size() numbers of work
    const Tables& tables;
    const Moduli& moduli;
    const Connectivity& mesh;
    const double* points;
    double* data;
    bool affine;  // out: whether J was constant
};

// Numbers that one task needs: coordinates, J, weights, D and one weighted row of D, V of each.
inline int64_t work_size(const Tables& t, int V) {
    return V * (3 * t.k + 9 * t.g + 3 * t.g * t.k + t.g + 3 * t.g);
}

template <int V, int... I>
KL_INLINE void pick(vec<double, V>& to, const vec<double, V>& a, const vec<double, V>& b) {
#if defined(__clang__) || __GNUC__ >= 12
    to = __builtin_shufflevector(a, b, I...);
#else
    to = __builtin_shuffle(a, b, vec<int64_t, V>{I...});
#endif
}

// r[l][e] = v[e][l]
KL_INLINE void transpose(const vec<double, 2>* v, vec<double, 2>* r) {
    pick<2, 0, 2>(r[0], v[0], v[1]);
    pick<2, 1, 3>(r[1], v[0], v[1]);
}

KL_INLINE void transpose(const vec<double, 4>* v, vec<double, 4>* r) {
    vec<double, 4> t[4];
    for (int i = 0; i < 2; ++i) {
        pick<4, 0, 4, 2, 6>(t[2 * i], v[2 * i], v[2 * i + 1]);
        pick<4, 1, 5, 3, 7>(t[2 * i + 1], v[2 * i], v[2 * i + 1]);
    }
    for (int i = 0; i < 2; ++i) {
        pick<4, 0, 1, 4, 5>(r[i], t[i], t[2 + i]);
        pick<4, 2, 3, 6, 7>(r[2 + i], t[i], t[2 + i]);
    }
}

KL_INLINE void transpose(const vec<double, 8>* v, vec<double, 8>* r) {
    vec<double, 8> t[8], s[8];
    for (int i = 0; i < 4; ++i) {
        pick<8, 0, 8, 2, 10, 4, 12, 6, 14>(t[2 * i], v[2 * i], v[2 * i + 1]);
        pick<8, 1, 9, 3, 11, 5, 13, 7, 15>(t[2 * i + 1], v[2 * i], v[2 * i + 1]);
    }
    for (int i = 0; i < 8; i += 4)
        for (int j = 0; j < 2; ++j) {
            pick<8, 0, 1, 8, 9, 4, 5, 12, 13>(s[i + j], t[i + j], t[i + 2 + j]);
            pick<8, 2, 3, 10, 11, 6, 7, 14, 15>(s[i + 2 + j], t[i + j], t[i + 2 + j]);
        }
    for (int j = 0; j < 4; ++j) {
        pick<8, 0, 1, 2, 3, 8, 9, 10, 11>(r[j], s[j], s[4 + j]);
        pick<8, 4, 5, 6, 7, 12, 13, 14, 15>(r[4 + j], s[j], s[4 + j]);
    }
}

// Add V blocks, one of each element, to their places, and fetch those of the next group.
template <int V>
KL_INLINE void add_blocks(double* data, const int32_t* place, int64_t stride, int64_t ahead,
                          const vec<double, V>* K) {
    vec<double, V> rows[8];
    for (int i = 0; i < 8 / V; ++i) transpose(K + i * V, rows + i * V);
    for (int l = 0; l < V; ++l) {
        const int64_t p = place[l * stride];
        __builtin_prefetch(data + 9 * static_cast<int64_t>(place[l * stride + ahead]), 1);
        if (p < 0) continue;
        double* block = data + 9 * p;
        for (int i = 0; i < 8 / V; ++i) *reinterpret_cast<vec<double, V>*>(block + i * V) += rows[i * V + l];
        block[8] += K[8][l];
    }
}

template <int V>
KL_INLINE void contract(const Moduli& m, const vec<double, V>* P, vec<double, V>* K) {
    if (m.isotropic) {
        const vec<double, V> trace = m.mu * (P[0] + P[4] + P[8]);
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) K[3 * i + j] = m.lambda * P[3 * i + j] + m.mu * P[3 * j + i];
        for (int i = 0; i < 3; ++i) K[4 * i] += trace;
        return;
    }
    for (int ij = 0; ij < 9; ++ij) {
        vec<double, V> sum = m.tensor[ij][0] * P[0];
        for (int kl = 1; kl < 9; ++kl) sum += m.tensor[ij][kl] * P[kl];
        K[ij] = sum;
    }
}

// Add the block of the nodes a, b and its mirror image to the matrix.
template <int V>
KL_INLINE void add_pair(const Task& t, int k, int a, int b, const vec<double, V>* P) {
    vec<double, V> K[9];
    contract<V>(t.moduli, P, K);
    add_blocks<V>(t.data, t.place + a * k + b, k * k, t.ahead, K);
    if (a == b) return;
    const vec<double, V> mirror[9] = {K[0], K[3], K[6], K[1], K[4], K[7], K[2], K[5], K[8]};
    add_blocks<V>(t.data, t.place + b * k + a, k * k, t.ahead, mirror);
}

template <int V>
KL_INLINE void gather(const Task& t, int k, vec<double, V>* X) {
    for (int l = 0; l < V; ++l) {
        const int64_t e = std::min(t.first + l, t.mesh.count - 1);
        for (int a = 0; a < k; ++a)
            for (int i = 0; i < 3; ++i)
                X[3 * a + i][l] = t.points[3 * static_cast<int64_t>(t.mesh.nodes[e * k + a]) + i];
    }
}

// J[i][j] = dX_i/dxi_j at each Gauss point.
template <int V>
KL_INLINE void jacobians(const Task& t, int k, int g, const vec<double, V>* X, vec<double, V>* J) {
    for (int q = 0; q < g; ++q) {
        vec<double, V> sum[9] = {};
        for (int a = 0; a < k; ++a)
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j) sum[3 * i + j] += X[3 * a + i] * t.tables.dN[3 * (q * k + a) + j];
        for (int c = 0; c < 9; ++c) J[9 * q + c] = sum[c];
    }
}

// Whether J differs between Gauss points by no more than the rounding of its sums.
template <int V>
KL_INLINE bool constant(int k, int g, const vec<double, V>* X, const vec<double, V>* J) {
    vec<double, V> size = {}, change = {};
    for (int c = 0; c < 3 * k; ++c) {
        const vec<double, V> x = X[c] < 0 ? -X[c] : X[c];
        size = x > size ? x : size;
    }
    for (int q = 1; q < g; ++q)
        for (int c = 0; c < 9; ++c) {
            const vec<double, V> d = J[9 * q + c] - J[c], x = d < 0 ? -d : d;
            change = x > change ? x : change;
        }
    for (int l = 0; l < V; ++l)
        if (!(change[l] <= 8 * DBL_EPSILON * size[l])) return false;
    return true;
}

// Turn J into det(J) J^-1.
template <int V>
KL_INLINE void invert(vec<double, V>* J, vec<double, V>& det) {
    vec<double, V> m[9];
    for (int c = 0; c < 9; ++c) m[c] = J[c];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            const int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
            J[3 * j + i] = m[3 * a + c] * m[3 * b + d] - m[3 * a + d] * m[3 * b + c];
        }
    det = m[0] * J[0] + m[1] * J[3] + m[2] * J[6];
}

// All pairs from the gradients at the Gauss points.
template <int V>
KL_INLINE void by_points(const Task& t, int k, int g, vec<double, V>* J, vec<double, V>* D) {
    vec<double, V>* weight = D + 3 * g * k;
    vec<double, V>* row = weight + g;
    for (int q = 0; q < g; ++q) {
        vec<double, V>* c = J + 9 * q;
        vec<double, V> det;
        invert<V>(c, det);
        weight[q] = t.tables.weights[q] / det;
        for (int a = 0; a < k; ++a) {
            const double* dN = t.tables.dN + 3 * (q * k + a);
            for (int i = 0; i < 3; ++i)
                D[3 * (a * g + q) + i] = dN[0] * c[i] + dN[1] * c[3 + i] + dN[2] * c[6 + i];
        }
    }
    for (int a = 0; a < k; ++a) {
        for (int q = 0; q < g; ++q)
            for (int i = 0; i < 3; ++i) row[3 * q + i] = weight[q] * D[3 * (a * g + q) + i];
        for (int b = a; b < k; ++b) {
            vec<double, V> P[9] = {};
            for (int q = 0; q < g; ++q) {
                const vec<double, V>* Db = D + 3 * (b * g + q);
                for (int i = 0; i < 3; ++i)
                    for (int j = 0; j < 3; ++j) P[3 * i + j] += row[3 * q + i] * Db[j];
            }
            add_pair<V>(t, k, a, b, P);
        }
    }
}

// All pairs from the products of the reference cell.
template <int V>
KL_INLINE void by_products(const Task& t, int k, vec<double, V>* J) {
    vec<double, V> det;
    invert<V>(J, det);
    vec<double, V> c[9], scaled[9];
    for (int i = 0; i < 9; ++i) {
        c[i] = J[i];
        scaled[i] = J[i] / det;
    }
    const double* R = t.tables.products.data();
    for (int a = 0; a < k; ++a)
        for (int b = a; b < k; ++b, R += 9) {
            vec<double, V> T[9], P[9];
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    T[3 * i + j] = R[3 * i] * scaled[j] + R[3 * i + 1] * scaled[3 + j] +
                                   R[3 * i + 2] * scaled[6 + j];
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    P[3 * i + j] = c[i] * T[j] + c[3 + i] * T[3 + j] + c[6 + i] * T[6 + j];
            add_pair<V>(t, k, a, b, P);
        }
}

template <int V>
KL_INLINE void group(Task& t, int k, int g) {
    vec<double, V>* X = reinterpret_cast<vec<double, V>*>(t.work);
    vec<double, V>* J = X + 3 * k;
    gather<V>(t, k, X);
    jacobians<V>(t, k, g, X, J);
    t.affine = !t.tables.products.empty() && constant<V>(k, g, X, J);
    if (t.affine)
        by_products<V>(t, k, J);
    else
        by_points<V>(t, k, g, J, J + 9 * g);
}

template <int V>
KL_INLINE void any_group(Task& t) {
    group<V>(t, t.tables.k, t.tables.g);
}
KL_DISPATCH(add_group, any_group, double, Task&)

// Add the stiffness of all elements to data (nnz, 3, 3); return how many groups had constant J.
inline int64_t add_stiffness(const Tables& tables, const Moduli& moduli, const Connectivity& mesh,
                             const double* points, const Graph& graph, double* data) {
    std::atomic<int64_t> affine{0};
    const int V = lanes();
    for_groups(mesh, graph, V, work_size(tables, V), [&](const Group& group) {
        Task task{group, tables, moduli, mesh, points, data, false};
        add_group(task);
        affine += task.affine;
    });
    return affine;
}

// Add given element matrices, R x R blocks (count, k, k, R, R), to data (nnz, R, R).
template <int R>
void add_matrices(const Connectivity& mesh, const double* blocks, const Graph& graph, double* data) {
    const int64_t pairs = static_cast<int64_t>(mesh.k) * mesh.k;
    for_groups(mesh, graph, 1, 0, [&](const Group& element) {
        const double* block = blocks + R * R * pairs * element.first;
        for (int64_t p = 0; p < pairs; ++p, block += R * R) {
            const int64_t place = element.place[p];
            for (int i = 0; place >= 0 && i < R * R; ++i) data[R * R * place + i] += block[i];
        }
    });
}

}  // namespace kl
