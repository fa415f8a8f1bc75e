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
#include <cstdint>
#include <vector>

#include "assembly.hpp"
#include "condensed.hpp"

namespace kl {

struct Moduli {
    bool isotropic;
    double lambda, mu;
    double tensor[9][9];    // [ij][kl]
    double coupling[3][3];  // stress of the projected dilatation
};

struct Stiffness : Elements {
    Moduli moduli;
    std::vector<double> products;  // R (pairs, 9), or none where they do not pay
    double* data;
    const double* factors;         // (m) of the stiffness of elements, or null

    bool affine_pays() const {
        const int pairs = k * (k + 1) / 2;
        return pairs * 54 + 9 * g * k < 0.8 * (pairs * 9 * g + 18 * g * k);
    }
    // Numbers that one chunk needs: coordinates, J, weights, D and one weighted row of D, V of each.
    int64_t added_from() const { return 3 * k + 9 * g + 3 * g * k + g + 3 * g; }
    int64_t size(int V) const { return V * (added_from() + addition.terms * (addition.terms + 3 * k)); }
};

// ---- what elements add to the blocks of a row a: nothing, enhanced modes, projected dilatation -------

template <int V>
struct NothingAdded {
    typedef vec<double, V> Vec;
    KL_INLINE NothingAdded(const Stiffness&, const Vec*, const Vec (*)[3][3], Vec*) {}
    KL_INLINE void row(int) {}
    KL_INLINE void add(int, Vec*) const {}
};

template <int V>
struct ModesAdded {
    typedef vec<double, V> Vec;
    Enhanced<V> m;
    Vec Q[12][12] = {}, left[PRODUCTS][9];

    KL_INLINE ModesAdded(const Stiffness& w, const Vec* X, const Vec (*J)[3][3], Vec*) {
        const int at[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
        find_modes<V>(w, X, J, m);
        for_independent<V, 12>(m, [&](int first, int n, Vec* rows) KL_INLINE_LAMBDA {
            for (int i = 0; i < n; ++i) {
                const Vec *S = m.stress[COMPONENT[first + i]], *L = &m.gradient[MONOMIAL[first + i]][0][0];
                for (int c = 0; c < 12; ++c) {
                    const Vec *g = L + c / 3 * 3;
                    const int *s = at[c % 3];
                    rows[i * (n + 12) + n + c] = S[s[0]] * g[0] + S[s[1]] * g[1] + S[s[2]] * g[2];
                }
            }
            eliminate<V>(rows, n, n + 12);
            for (int i = 0; i < n; ++i, rows += n + 12)
                for (int c = 0; c < 12; ++c) {
                    const Vec factor = rows[i] * rows[n + c];
                    for (int d = c; d < 12; ++d) Q[c][d] -= factor * rows[n + d];
                }
        });
        for (int c = 0; c < 12; ++c)
            for (int d = 0; d < c; ++d) Q[c][d] = Q[d][c];
    }

    KL_INLINE void row(int a) {
        for (int h = 0; h < PRODUCTS; ++h)
            for (int ij = 0; ij < 9; ++ij) {
                left[h][ij] = Vec{};
                for (int o = 0; o < PRODUCTS; ++o)
                    left[h][ij] += m.gamma[a][o] * Q[3 * o + ij / 3][3 * h + ij % 3];
            }
    }

    KL_INLINE void add(int b, Vec* K) const {
        for (int h = 0; h < PRODUCTS; ++h)
            for (int ij = 0; ij < 9; ++ij) K[ij] += left[h][ij] * m.gamma[b][h];
    }
};

template <int V>
struct DilatationAdded {
    typedef vec<double, V> Vec;
    const Moduli& moduli;
    const int n, width;
    Vec *rows, left[4][3];  // P^T P and P^T dN/dX, eliminated

    KL_INLINE DilatationAdded(const Stiffness& w, const Vec* X, const Vec (*J)[3][3], Vec* room)
        : moduli(w.moduli), n(w.addition.terms), width(n + 3 * w.k), rows(room) {
        for (int i = 0; i < n * width; ++i) rows[i] = Vec{};
        for (int q = 0; q < w.g; ++q) {
            Vec c[3][3], det, P[4];
            invert<V>(J[q], c, det);
            polynomials<V>(w, X, q, P);
            for (int r = 0; r < n; ++r) {
                P[r] *= w.weights[q];
                for (int o = 0; o <= r; ++o) rows[o * width + r] += P[o] * P[r] * det / w.weights[q];
            }
            const double* dN = w.dN_at(q);
            for (int a = 0; a < w.k; ++a, dN += 3)
                for (int i = 0; i < 3; ++i) {
                    const Vec D = dN[0] * c[0][i] + dN[1] * c[1][i] + dN[2] * c[2][i];
                    for (int r = 0; r < n; ++r) rows[r * width + n + 3 * a + i] += P[r] * D;
                }
        }
        eliminate<V>(rows, n, width);
    }

    KL_INLINE void row(int a) {
        for (int r = 0; r < n; ++r)
            for (int i = 0; i < 3; ++i) left[r][i] = rows[r * width + r] * rows[r * width + n + 3 * a + i];
    }

    KL_INLINE void add(int b, Vec* K) const {
        const double(&S)[3][3] = moduli.coupling;
        Vec Y[3][3] = {};
        for (int r = 0; r < n; ++r)
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j) Y[i][j] += left[r][i] * rows[r * width + n + 3 * b + j];
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) {
                if (moduli.isotropic)
                    K[3 * i + j] += 2 * S[0][0] * Y[i][j];
                else
                    for (int l = 0; l < 3; ++l) K[3 * i + j] += S[i][l] * Y[l][j] + Y[i][l] * S[l][j];
            }
    }
};

template <int V>
KL_INLINE void scale(const vec<double, V>& factor, vec<double, V>* K) {
    for (int ij = 0; ij < 9; ++ij) K[ij] *= factor;
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

// All pairs from the gradients at the Gauss points.
template <int V, class Added>
KL_INLINE void by_points(const Stiffness& w, Chunk chunk, int k, int g, vec<double, V> (*J)[3][3],
                         const vec<double, V>& factor, Added& added) {
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
        added.row(a);
        for (int b = a; b < k; ++b) {
            Vec P[9] = {}, K[9];
            for (int q = 0; q < g; ++q) {
                const Vec* Db = D + 3 * (b * g + q);
                for (int i = 0; i < 3; ++i)
                    for (int j = 0; j < 3; ++j) P[3 * i + j] += row[3 * q + i] * Db[j];
            }
            contract<V>(w.moduli, P, K);
            added.add(b, K);
            if (w.factors) scale<V>(factor, K);
            add_pair<V>(w.data, chunk, k, a, b, true, K);
        }
    }
}

// All pairs from the products of the reference cell.
template <int V, class Added>
KL_INLINE void by_products(const Stiffness& w, Chunk chunk, int k, const vec<double, V> (&J)[3][3],
                           const vec<double, V>& factor, Added& added) {
    vec<double, V> c[3][3], scaled[3][3], det;
    invert<V>(J, c, det);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) scaled[i][j] = c[i][j] / det;
    const double* R = w.products.data();
    for (int a = 0; a < k; ++a) {
        added.row(a);
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
            added.add(b, K);
            if (w.factors) scale<V>(factor, K);
            add_pair<V>(w.data, chunk, k, a, b, true, K);
        }
    }
}

// Add V elements; return whether J was constant in each.
template <int V, class Added>
KL_INLINE bool add_stiffness(const Stiffness& w, Chunk chunk, int k, int g) {
    vec<double, V>* X = reinterpret_cast<vec<double, V>*>(chunk.work);
    auto* J = reinterpret_cast<vec<double, V>(*)[3][3]>(X + 3 * k);
    gather<V>(w, w.points, chunk.first, X);
    for (int q = 0; q < g; ++q) reference_gradient<V>(X, w.dN_at(q), k, J[q]);
    const bool affine = !w.products.empty() && constant<V>(k, g, X, &J[0][0][0]);
    Added added(w, X, J, X + w.added_from());
    vec<double, V> factor{};
    for (int lane = 0; w.factors && lane < V; ++lane)
        factor[lane] = w.factors[std::min(chunk.first + lane, w.last - 1)];
    if (affine)
        by_products<V>(w, chunk, k, J[0], factor, added);
    else
        by_points<V>(w, chunk, k, g, J, factor, added);
    return affine;
}

// Add the stiffness of all elements to data (nnz, 3, 3); return how many chunks had constant J.
template <template <int> class Added>
int64_t add_stiffness(const Stiffness& w, const Graph& graph) {
    std::atomic<int64_t> affine{0};
    const int V = vector_width();
    for_chunks({w.nodes, w.last, w.k}, graph, V, w.size(V), [&](const Chunk& chunk) {
        dispatch<double>([&](auto V) KL_INLINE_LAMBDA { affine += add_stiffness<V, Added<V>>(w, chunk, w.k, w.g); });
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
