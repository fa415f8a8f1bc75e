// The matrices of mass that rests or flows with c(X) = A X + b, V elements at once, one number for each
// pair of nodes:
//
//     M_ab = ∫ ρ N_a N_b,    G_ab = ∫ ρ N_a c·grad N_b,    H_ab = ∫ ρ (c·grad N_a)(c·grad N_b).
//
// c·grad N_b = dN_b · (J^-1 c), so that no gradient is ever formed.  One pass over the Gauss points serves
// all that is asked for; then a matrix is a product over the points, computed in tiles of node pairs.

#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "assembly.hpp"
#include "gauss.hpp"

namespace kl {

constexpr int TILE_ROWS = 2, TILE_COLUMNS = 4;  // eight sums at a time keep the multipliers busy

// Elements, their flow, and what is asked for.
struct Inertia : Elements {
    const double* velocity;        // (3, 4): A and b
    double *M, *G, *H;             // data of a matrix, or null where it is not asked for
    std::vector<double> N_padded;  // (g, padded_k), zeros behind N

    int padded_k() const { return (k + TILE_COLUMNS - 1) / TILE_COLUMNS * TILE_COLUMNS; }
    bool flows() const { return G || H; }
    // Numbers that one chunk needs: coordinates, velocities, volumes, c·grad N, and weighted rows of a tile.
    int64_t size(int V) const { return V * (6 * k + static_cast<int64_t>(g) * (1 + padded_k() + TILE_ROWS)); }
};

// Coordinates from the first node of each element on, and the velocity at its nodes.
template <int V>
KL_INLINE void gather_flow(const Inertia& w, int64_t e, vec<double, V>* X, vec<double, V>* c) {
    gather<V>(w, w.points, e, X);
    for (int a = 0; w.flows() && a < w.k; ++a)
        for (int i = 0; i < 3; ++i) {
            const double* A = w.velocity + 4 * i;
            c[3 * a + i] = A[0] * X[3 * a] + A[1] * X[3 * a + 1] + A[2] * X[3 * a + 2] + A[3];
        }
    shift_to_first_node<V>(X, w.k);
}

// ρ dV and c·grad N (padded_k) at one Gauss point.
template <int V>
KL_INLINE void inertia_at(const Inertia& w, const vec<double, V>* X, const vec<double, V>* c, int q,
                          vec<double, V>& dV, vec<double, V>* convective) {
    typedef vec<double, V> Vec;
    Vec cofactors[3][3], det;
    jacobian<V>(w, X, q, cofactors, det);
    dV = det * w.weights[q];
    if (!w.flows()) return;
    const double *N = w.N + static_cast<int64_t>(w.k) * q, *dN = w.dN_at(q);
    Vec flow[3] = {}, r[3];
    for (int a = 0; a < w.k; ++a)
        for (int i = 0; i < 3; ++i) flow[i] += N[a] * c[3 * a + i];
    const Vec scale = 1.0 / det;
    for (int j = 0; j < 3; ++j)
        r[j] = scale * (cofactors[j][0] * flow[0] + cofactors[j][1] * flow[1] + cofactors[j][2] * flow[2]);
    for (int a = 0; a < w.k; ++a) convective[a] = dN[3 * a] * r[0] + dN[3 * a + 1] * r[1] + dN[3 * a + 2] * r[2];
    for (int a = w.k; a < w.padded_k(); ++a) convective[a] = Vec{};
}

template <int V>
KL_INLINE void add_value(const Inertia& w, const Chunk& chunk, int a, int b, const vec<double, V>& value,
                         double* data) {
    const int k = w.k;
    const int32_t* at = chunk.position + a * k + b;
    for (int l = 0; l < V; ++l, at += k * k)
        if (*at >= 0) data[*at] += value[l];
}

// Add one tile of Σ rows[a] columns[b] over the points, and its mirror image to a symmetric matrix.
template <int V, class Column>
KL_INLINE void add_tile(const Inertia& w, const Chunk& chunk, const vec<double, V>* rows,
                        const Column* columns, int a0, int b0, bool symmetric, double* data) {
    const int k = w.k, padded = w.padded_k();
    vec<double, V> sum[TILE_ROWS][TILE_COLUMNS] = {};
    for (int q = 0; q < w.g; ++q, rows += TILE_ROWS, columns += padded)
        for (int i = 0; i < TILE_ROWS; ++i)
            for (int j = 0; j < TILE_COLUMNS; ++j) sum[i][j] += rows[i] * columns[b0 + j];
    for (int i = 0; i < TILE_ROWS; ++i)
        for (int j = 0; j < TILE_COLUMNS; ++j) {
            const int a = a0 + i, b = b0 + j;
            if (a >= k || b >= k || (symmetric && b < a)) continue;
            add_value<V>(w, chunk, a, b, sum[i][j], data);
            if (symmetric && a != b) add_value<V>(w, chunk, b, a, sum[i][j], data);
        }
}

// Two rows of a matrix; of a symmetric one, from the diagonal on.
template <int V, class Column>
KL_INLINE void add_rows(const Inertia& w, const Chunk& chunk, const vec<double, V>* rows,
                        const Column* columns, int a0, bool symmetric, double* data) {
    for (int b0 = symmetric ? a0 / TILE_COLUMNS * TILE_COLUMNS : 0; b0 < w.k; b0 += TILE_COLUMNS)
        add_tile<V>(w, chunk, rows, columns, a0, b0, symmetric, data);
}

// rows[q][i] = dV columns[q][a0 + i]
template <int V, class Column>
KL_INLINE void weigh(const Inertia& w, const vec<double, V>* dV, const Column* columns, int a0,
                     vec<double, V>* rows) {
    for (int q = 0; q < w.g; ++q)
        for (int i = 0; i < TILE_ROWS; ++i) rows[TILE_ROWS * q + i] = dV[q] * columns[q * w.padded_k() + a0 + i];
}

template <int V>
KL_INLINE void add_inertia(const Inertia& w, const Chunk& chunk) {
    typedef vec<double, V> Vec;
    Vec* X = reinterpret_cast<Vec*>(chunk.work);
    Vec *c = X + 3 * w.k, *dV = c + 3 * w.k, *rows = dV + w.g, *convective = rows + TILE_ROWS * w.g;
    gather_flow<V>(w, chunk.first, X, c);
    for (int q = 0; q < w.g; ++q) inertia_at<V>(w, X, c, q, dV[q], convective + q * w.padded_k());
    const double* N = w.N_padded.data();
    for (int a0 = 0; a0 < w.k; a0 += TILE_ROWS) {
        if (w.M || w.G) weigh<V>(w, dV, N, a0, rows);
        if (w.M) add_rows<V>(w, chunk, rows, N, a0, true, w.M);
        if (w.G) add_rows<V>(w, chunk, rows, convective, a0, false, w.G);
        if (!w.H) continue;
        weigh<V>(w, dV, convective, a0, rows);
        add_rows<V>(w, chunk, rows, convective, a0, true, w.H);
    }
}

}  // namespace kl
