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

#include "assembly.hpp"
#include "gauss.hpp"

namespace kl {

struct Moduli {
    bool isotropic;
    double lambda, mu;
    double tensor[9][9];  // [ij][kl]
};

struct Stiffness : Elements {
    Moduli moduli;
    std::vector<double> products;  // R (pairs, 9), or none where they do not pay
    double* data;

    bool affine_pays() const {
        const int pairs = k * (k + 1) / 2;
        return pairs * 54 + 9 * g * k < 0.8 * (pairs * 9 * g + 18 * g * k);
    }
    // Numbers that one chunk needs: coordinates, J, weights, D and one weighted row of D, V of each.
    int64_t size(int V) const { return V * (3 * k + 9 * g + 3 * g * k + g + 3 * g); }
};

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

// Whether J differs between Gauss points by no more than the rounding of its sums.
template <int V>
KL_INLINE bool constant(int k, int g, const vec<double, V>* X, const vec<double, V>* J) {
    vec<double, V> size, change = {};
    largest<V>(X, 3 * k, size);
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

// All pairs from the gradients at the Gauss points.
template <int V>
KL_INLINE void by_points(const Stiffness& w, Chunk chunk, int k, int g, vec<double, V> (*J)[3][3]) {
    typedef vec<double, V> Vec;
    Vec *D = reinterpret_cast<Vec*>(J + g), *weight = D + 3 * g * k, *row = weight + g;
    for (int q = 0; q < g; ++q) {
        Vec c[3][3], det;
        invert<V>(J[q], c, det);
        weight[q] = w.weights[q] / det;
        const double* dN = w.dN_at(q);
        for (int a = 0; a < k; ++a, dN += 3)
            for (int i = 0; i < 3; ++i)
                D[3 * (a * g + q) + i] = dN[0] * c[0][i] + dN[1] * c[1][i] + dN[2] * c[2][i];
    }
    for (int a = 0; a < k; ++a) {
        for (int q = 0; q < g; ++q)
            for (int i = 0; i < 3; ++i) row[3 * q + i] = weight[q] * D[3 * (a * g + q) + i];
        for (int b = a; b < k; ++b) {
            Vec P[9] = {}, K[9];
            for (int q = 0; q < g; ++q) {
                const Vec* Db = D + 3 * (b * g + q);
                for (int i = 0; i < 3; ++i)
                    for (int j = 0; j < 3; ++j) P[3 * i + j] += row[3 * q + i] * Db[j];
            }
            contract<V>(w.moduli, P, K);
            add_pair<V>(w.data, chunk, k, a, b, true, K);
        }
    }
}

// All pairs from the products of the reference cell.
template <int V>
KL_INLINE void by_products(const Stiffness& w, Chunk chunk, int k, const vec<double, V> (&J)[3][3]) {
    vec<double, V> c[3][3], scaled[3][3], det;
    invert<V>(J, c, det);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) scaled[i][j] = c[i][j] / det;
    const double* R = w.products.data();
    for (int a = 0; a < k; ++a)
        for (int b = a; b < k; ++b, R += 9) {
            vec<double, V> T[3][3], P[9], K[9];
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    T[i][j] =
                        R[3 * i] * scaled[0][j] + R[3 * i + 1] * scaled[1][j] + R[3 * i + 2] * scaled[2][j];
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    P[3 * i + j] = c[0][i] * T[0][j] + c[1][i] * T[1][j] + c[2][i] * T[2][j];
            contract<V>(w.moduli, P, K);
            add_pair<V>(w.data, chunk, k, a, b, true, K);
        }
}

// Add V elements; return whether J was constant in each.
template <int V>
KL_INLINE bool add_stiffness(const Stiffness& w, Chunk chunk, int k, int g) {
    vec<double, V>* X = reinterpret_cast<vec<double, V>*>(chunk.work);
    auto* J = reinterpret_cast<vec<double, V>(*)[3][3]>(X + 3 * k);
    gather<V>(w, w.points, chunk.first, X);
    for (int q = 0; q < g; ++q) reference_gradient<V>(X, w.dN_at(q), k, J[q]);
    const bool affine = !w.products.empty() && constant<V>(k, g, X, &J[0][0][0]);
    if (affine)
        by_products<V>(w, chunk, k, J[0]);
    else
        by_points<V>(w, chunk, k, g, J);
    return affine;
}

// Add the stiffness of all elements to data (nnz, 3, 3); return how many chunks had constant J.
inline int64_t add_stiffness(const Stiffness& w, const Graph& graph) {
    std::atomic<int64_t> affine{0};
    const int V = vector_width();
    for_chunks({w.nodes, w.last, w.k}, graph, V, w.size(V), [&](const Chunk& chunk) {
        dispatch<double>([&](auto V) KL_INLINE_LAMBDA { affine += add_stiffness<V>(w, chunk, w.k, w.g); });
    });
    return affine;
}

// Add given element matrices, R x R blocks (count, k, k, R, R), to data (nnz, R, R).
template <int R>
void add_matrices(const Connectivity& mesh, const double* blocks, const Graph& graph, double* data) {
    const int64_t pairs = static_cast<int64_t>(mesh.k) * mesh.k;
    for_chunks(mesh, graph, 1, 0, [&](const Chunk& element) {
        const double* block = blocks + R * R * pairs * element.first;
        for (int64_t p = 0; p < pairs; ++p, block += R * R) {
            const int64_t at = element.position[p];
            for (int i = 0; at >= 0 && i < R * R; ++i) data[R * R * at + i] += block[i];
        }
    });
}

}  // namespace kl
