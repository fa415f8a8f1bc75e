// Smoothed aggregation of whole clusters: aggregates and prolongator.

#pragma once
#include "clusters.hpp"
#include "galerkin.hpp"

namespace kl {

// Aggregates of whole clusters.  Between clusters geometry weakens links, which are weak only at a
// stiffness contrast.
inline int32_t aggregate_clusters(int b, const Graph& g, const double* A, const Clusters& clusters, const Bytes& excluded,
                                  const Bytes& strong, Ints& of) {
    const Doubles own = diagonal_norms(g, A, b * b);
    const auto alone = [&](int64_t i) {
        return clusters.starts[clusters.of[i] + 1] - clusters.starts[clusters.of[i]] == 1;
    };
    const auto counts = [&](int64_t i, int32_t k) {
        const int32_t j = g.indices[k];
        if (excluded[i] || excluded[j]) return false;
        if (strong.empty() || strong[k]) return true;
        return !alone(i) && !alone(j) && std::fmax(own[i], own[j]) <= CONTRAST * std::fmin(own[i], own[j]) &&
               squared_norm(A + int64_t{k} * b * b, b * b) > 0;
    };
    Ints indptr, indices, ends(1), others;  // clusters that each node is linked to
    for (int64_t i = 0; i < g.rows; ++i) {
        others.push_back(clusters.of[i]);
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k)
            if (counts(i, k)) others.push_back(clusters.of[g.indices[k]]);
        ends.push_back(static_cast<int32_t>(others.size()));
    }
    UnionRows(clusters.count(), clusters.count(), [&](int64_t c, const auto& add) {
        for (int32_t p = clusters.starts[c]; p < clusters.starts[c + 1]; ++p)
            std::for_each(&others[ends[clusters.members[p]]], &others[ends[clusters.members[p] + 1]], add);
    }).copy_to(indptr, indices);
    Bytes held(clusters.count(), 1);
    for (int64_t i = 0; i < g.rows; ++i) held[clusters.of[i]] &= excluded[i];
    Ints joined;
    const int32_t count = aggregate({clusters.count(), indptr.data(), indices.data()}, held, {}, joined);
    of.resize(g.rows);
    for (int64_t i = 0; i < g.rows; ++i) of[i] = excluded[i] ? -1 : joined[clusters.of[i]];
    return count;
}

// A T in the rows of one cluster, each column (rows, b, 6) of blocks by itself.
template <int b>
KL_INLINE void cluster_product(const Smoothing& s, const int32_t* members, int64_t nodes, const int32_t* columns,
                               int64_t count, double* X) {
    constexpr int size = b * MODES;
    for (int64_t p = 0; p < nodes; ++p) {
        const int32_t i = members[p];
        for (int32_t k = s.g.indptr[i]; s.of[i] >= 0 && k < s.g.indptr[i + 1]; ++k) {
            const int32_t j = s.g.indices[k];
            if (s.of[j] < 0) continue;
            const int64_t at = std::lower_bound(columns, columns + count, s.of[j] * s.sets) - columns;
            for (int e = 0; e < s.sets; ++e)
                add_product<b, b>(X + ((at + e) * nodes + p) * size, s.A + int64_t{k} * b * b,
                                  &s.T[(int64_t{j} * s.sets + e) * size]);
        }
    }
}

// P = T - omega D^-1 A T with the clusters' D; each node has the columns of its whole cluster.
inline Prolongator smoothed_prolongator(const Smoothing& s, const Clusters& clusters) {
    const int b = s.b, size = b * MODES;
    Ints starts, columns;
    UnionRows(clusters.count(), s.coarse_nodes(), [&](int64_t c, const auto& add) {
        for (int32_t p = clusters.starts[c]; p < clusters.starts[c + 1]; ++p) s.add_columns(clusters.members[p], add);
    }).copy_to(starts, columns);
    Prolongator P;
    P.indptr.assign(s.g.rows + 1, 0);
    for (int64_t i = 0; i < s.g.rows; ++i) {
        const int32_t c = clusters.of[i];
        P.indptr[i + 1] = s.of[i] < 0 ? 0 : starts[c + 1] - starts[c];
    }
    std::partial_sum(P.indptr.begin(), P.indptr.end(), P.indptr.begin());
    P.indices.resize(P.indptr.back());
    P.data.resize(P.indices.size() * size + 8);
    clusters.over(256, [&](int64_t first, int64_t last) {
        Doubles X;
        for (int64_t c = first; c < last; ++c) {
            const int64_t start = clusters.starts[c], nodes = clusters.starts[c + 1] - start;
            const int32_t* own = columns.data() + starts[c];
            const int64_t count = starts[c + 1] - starts[c];
            X.assign(static_cast<size_t>(count * nodes * size), 0.0);
            with_size(b, [&](auto B) {
                dispatch<double>([&](auto) KL_INLINE_LAMBDA {
                    cluster_product<decltype(B)::value>(s, &clusters.members[start], nodes, own, count, X.data());
                    for (int64_t e = 0; e < count; ++e)
                        substitute_six(clusters.exact, start * b, (start + nodes) * b, &X[e * nodes * size]);
                });
            });
            for (int64_t p = 0; p < nodes; ++p) {
                const int64_t i = clusters.members[start + p];
                if (s.of[i] < 0) continue;
                std::copy_n(own, count, P.indices.begin() + P.indptr[i]);
                for (int64_t e = 0; e < count; ++e)
                    s.store(i, own[e], &X[(e * nodes + p) * size], &P.data[(P.indptr[i] + e) * size]);
            }
        }
    });
    return P;
}

}  // namespace kl
