// Smoothed aggregation of whole clusters: aggregates and prolongator.

#pragma once
#include "clusters.hpp"

namespace kl {

// Aggregates of whole clusters.  Between clusters geometry weakens links, which are weak only if the
// stiffness at their ends is unlike.
template <int b>
int32_t aggregate_clusters(const Graph& g, const double* A, const Clusters& clusters,
                           const std::vector<uint8_t>& apart, const std::vector<uint8_t>& strong, Ints& of) {
    const std::vector<double> own = diagonal_norms(g, A, b * b);
    const auto alone = [&](int64_t i) {
        return clusters.starts[clusters.of[i] + 1] - clusters.starts[clusters.of[i]] == 1;
    };
    const auto counts = [&](int64_t i, int32_t k) {
        const int32_t j = g.indices[k];
        if (apart[i] || apart[j]) return false;
        if (strong.empty() || strong[k]) return true;
        return !alone(i) && !alone(j) && std::fmax(own[i], own[j]) <= UNLIKE * std::fmin(own[i], own[j]) &&
               squared_norm(A + int64_t{k} * b * b, b * b) > 0;
    };
    Ints indptr, indices, ends(1), others;  // clusters that each node is linked to
    for (int64_t i = 0; i < g.rows; ++i) {
        others.push_back(clusters.of[i]);
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k)
            if (counts(i, k)) others.push_back(clusters.of[g.indices[k]]);
        ends.push_back(static_cast<int32_t>(others.size()));
    }
    union_pattern(
        clusters.count(), clusters.count(),
        [&](int64_t c, const auto& add) {
            for (int32_t p = clusters.starts[c]; p < clusters.starts[c + 1]; ++p)
                add(others.data() + ends[clusters.members[p]], others.data() + ends[clusters.members[p] + 1]);
        },
        indptr, indices);
    std::vector<uint8_t> held(clusters.count(), 1);
    for (int64_t i = 0; i < g.rows; ++i) held[clusters.of[i]] &= apart[i];
    Ints joined;
    const int32_t count = aggregate({clusters.count(), indptr.data(), indices.data()}, held, {}, joined);
    of.resize(g.rows);
    for (int64_t i = 0; i < g.rows; ++i) of[i] = apart[i] ? -1 : joined[clusters.of[i]];
    return count;
}

// One cluster of a prolongator: A T in its rows, each column (rows, b, 6) by itself.
template <int b>
struct ClusterProduct {
    Graph g;
    const double* A;
    const Ints& of;
    const std::vector<double>& T;
    const int32_t* members;
    int64_t nodes;
    const int32_t* columns;
    int64_t count;
    double* X;
};

template <int b>
KL_INLINE void cluster_product(const ClusterProduct<b>& s) {
    constexpr int size = b * MODES;
    for (int64_t p = 0; p < s.nodes; ++p) {
        const int32_t i = s.members[p];
        if (s.of[i] < 0) continue;
        for (int32_t k = s.g.indptr[i]; k < s.g.indptr[i + 1]; ++k) {
            const int32_t j = s.g.indices[k];
            if (s.of[j] < 0) continue;
            const int64_t at = std::lower_bound(s.columns, s.columns + s.count, s.of[j]) - s.columns;
            add_product<b, b>(s.X + (at * s.nodes + p) * size, s.A + int64_t{k} * b * b, &s.T[int64_t{j} * size]);
        }
    }
}

template <int V>
KL_INLINE void cluster_product_3(const ClusterProduct<3>& s) { cluster_product<3>(s); }
template <int V>
KL_INLINE void cluster_product_6(const ClusterProduct<6>& s) { cluster_product<6>(s); }
KL_DISPATCH(multiply_cluster, cluster_product_3, double, const ClusterProduct<3>&)
KL_DISPATCH(multiply_cluster, cluster_product_6, double, const ClusterProduct<6>&)

// Aggregates that the nodes of each cluster are linked to: the columns of their rows of P.
inline void cluster_columns(const Graph& g, const Clusters& clusters, const Ints& of, Ints& starts, Ints& columns) {
    Ints aggregates(g.indptr[g.rows]);
    for (size_t k = 0; k < aggregates.size(); ++k) aggregates[k] = of[g.indices[k]];
    union_pattern(
        clusters.count(), g.rows,
        [&](int64_t c, const auto& add) {
            for (int32_t p = clusters.starts[c]; p < clusters.starts[c + 1]; ++p) {
                const int32_t i = clusters.members[p];
                for (int32_t k = g.indptr[i]; of[i] >= 0 && k < g.indptr[i + 1]; ++k)
                    if (aggregates[k] >= 0) add(&aggregates[k], &aggregates[k] + 1);
            }
        },
        starts, columns);
}

// P = T - omega D^-1 A T with the clusters' D; each node has the columns of its whole cluster.
template <int b>
Prolongator smoothed_prolongator(const Graph& g, const double* A, const Clusters& clusters,
                                 const std::vector<uint8_t>& fixed, const Ints& of,
                                 const std::vector<double>& T, double omega) {
    constexpr int size = b * MODES;
    Ints starts, columns;
    cluster_columns(g, clusters, of, starts, columns);
    Prolongator P;
    P.indptr.assign(g.rows + 1, 0);
    for (int64_t i = 0; i < g.rows; ++i) {
        const int32_t c = clusters.of[i];
        P.indptr[i + 1] = P.indptr[i] + (of[i] < 0 ? 0 : starts[c + 1] - starts[c]);
    }
    P.indices.resize(P.indptr[g.rows]);
    P.data.resize(static_cast<size_t>(P.indptr[g.rows]) * size + 8);  // lanes read beyond the end
    clusters.over(256, [&](int64_t first, int64_t last) {
        std::vector<double> X;
        for (int64_t c = first; c < last; ++c) {
            const int64_t start = clusters.starts[c], nodes = clusters.starts[c + 1] - start;
            const int32_t* own = columns.data() + starts[c];
            const int64_t count = starts[c + 1] - starts[c];
            X.assign(static_cast<size_t>(count * nodes * size), 0.0);
            multiply_cluster(
                ClusterProduct<b>{g, A, of, T, &clusters.members[start], nodes, own, count, X.data()});
            for (int64_t e = 0; e < count; ++e)
                substitute_six_some(
                    SixSubstitutions{clusters.exact, start * b, (start + nodes) * b, &X[e * nodes * size]});
            for (int64_t p = 0; p < nodes; ++p) {
                const int64_t i = clusters.members[start + p];
                if (of[i] < 0) continue;
                std::copy_n(own, count, P.indices.begin() + P.indptr[i]);
                for (int64_t e = 0; e < count; ++e) {
                    const double* smoothed = &X[(e * nodes + p) * size];
                    auto* out = &P.data[(P.indptr[i] + e) * size];
                    for (int k = 0; k < size; ++k) {
                        const double tentative = own[e] == of[i] ? T[i * size + k] : 0.0;
                        out[k] = fixed[i * b + k / MODES] ? 0.0 : tentative - omega * smoothed[k];
                    }
                }
            }
        }
    });
    return P;
}

}  // namespace kl
