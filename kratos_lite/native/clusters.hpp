// Clusters of nodes close together on a stretched mesh (lines across thin elements, planes across
// long ones).  Stiffness couples their nodes far more than others, so that only a smoother which
// solves each cluster exactly, and aggregates of whole clusters, serve conjugate gradients there.
//
// Source of block smoothing along strong couplings: Trottenberg, Oosterlee & Schüller, Multigrid
// (2001), section 5.1.  The tests on distances are our own.

#pragma once
#include <cmath>
#include <numeric>

#include "aggregation.hpp"

namespace kl {

constexpr double NEAR = 9, FAR = 16;     // squares of distances, to that of the nearest node
constexpr double BETWEEN = 0.1;          // of as many far links, at most so many neither near nor far
constexpr double FILL = 4;               // nodes in the envelope of a cluster, to its blocks in A
constexpr double UNLIKE = 1e3;           // stiffness of one node to that of another
constexpr int64_t SAMPLE = 2000;         // nodes that show whether a mesh is stretched

inline double squared_distance(const double* X, int64_t i, int64_t j) {
    double sum = 0;
    for (int c = 0; c < 3; ++c) sum += (X[3 * i + c] - X[3 * j + c]) * (X[3 * i + c] - X[3 * j + c]);
    return sum;
}

// Squares of the distances to the nearest and to the farthest linked node; nodes at the same place
// do not count.
inline std::pair<double, double> extent(const Graph& g, const double* X, int64_t i) {
    double low = INFINITY, high = 0;
    for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k) {
        const double d = squared_distance(X, i, g.indices[k]);
        if (d > 0) low = std::fmin(low, d);
        high = std::fmax(high, d);
    }
    return {low, high};
}

// Of some nodes of the whole mesh, have a few both near and far ones?
inline bool looks_stretched(const Graph& g, const double* X) {
    const int64_t step = std::max<int64_t>(1, g.rows / SAMPLE);
    int64_t seen = 0, stretched = 0;
    for (int64_t i = 0; i < g.rows; i += step, ++seen) {
        const auto [low, high] = extent(g, X, i);
        stretched += high > FAR * low;
    }
    return 20 * stretched > seen;
}

// A matrix in rows up to the diagonal, each from its first entry on, or its Cholesky factor.
template <class T>
struct Skyline {
    std::vector<int64_t> at;  // where each row starts
    std::vector<T> rows;      // left of the diagonal
    std::vector<T> pivots;    // the diagonal, or one over it: zero where there is no stiffness
};

template <class T, int V>
KL_INLINE T dot_product(const T* a, const T* b, int64_t n) {
    typedef vec<T, V> lane;
    lane lanes = {};
    T sum = 0;
    int64_t k = 0;
    for (; k + V <= n; k += V) lanes += *reinterpret_cast<const lane*>(a + k) * *reinterpret_cast<const lane*>(b + k);
    if (k)
        for (int v = 0; v < V; ++v) sum += lanes[v];
    for (; k < n; ++k) sum += a[k] * b[k];
    return sum;
}

// Rows [first, last) of a skyline, which no others are coupled to.
struct Factor {
    Skyline<double>& A;
    int64_t first, last;
};

template <int V>
KL_INLINE void factor_rows(const Factor& f) {
    Skyline<double>& A = f.A;
    for (int64_t i = f.first; i < f.last; ++i) {
        const int64_t start = i - (A.at[i + 1] - A.at[i]);
        double* row = A.rows.data() + A.at[i] - start;
        for (int64_t j = start; j < i; ++j) {
            const int64_t other = j - (A.at[j + 1] - A.at[j]), from = std::max(start, other);
            const double* column = A.rows.data() + A.at[j] - other;
            row[j] = (row[j] - dot_product<double, V>(row + from, column + from, j - from)) * A.pivots[j];
        }
        const double left = A.pivots[i] - dot_product<double, V>(row + start, row + start, i - start);
        A.pivots[i] = left > 1e-14 * A.pivots[i] ? 1 / std::sqrt(left) : 0;
    }
}
KL_DISPATCH(factorise_some, factor_rows, double, const Factor&)

// x = (L L^T)^-1 x on rows [first, last); x[0] belongs to the first.
struct Substitution {
    const Skyline<float>& L;
    int64_t first, last;
    float* x;
};

template <int V>
KL_INLINE void substitute_rows(const Substitution& s) {
    typedef vec<float, V> lane;
    const Skyline<float>& L = s.L;
    for (int64_t i = s.first; i < s.last; ++i) {
        const int64_t n = L.at[i + 1] - L.at[i];
        float& x = s.x[i - s.first];
        x = (x - dot_product<float, V>(L.rows.data() + L.at[i], &x - n, n)) * L.pivots[i];
    }
    for (int64_t i = s.last; i-- > s.first;) {
        const int64_t n = L.at[i + 1] - L.at[i];
        const float* row = L.rows.data() + L.at[i];
        const float x = s.x[i - s.first] *= L.pivots[i];
        float* others = s.x + (i - s.first) - n;
        int64_t k = 0;
        for (; k + V <= n; k += V) *reinterpret_cast<lane*>(others + k) -= *reinterpret_cast<const lane*>(row + k) * x;
        for (; k < n; ++k) others[k] -= row[k] * x;
    }
}
KL_DISPATCH(substitute_some, substitute_rows, float, const Substitution&)

// The same for six right sides, X (last - first, 6).
struct SixSubstitutions {
    const Skyline<double>& L;
    int64_t first, last;
    double* X;
};

template <int V>
KL_INLINE void substitute_six(const SixSubstitutions& s) {
    const Skyline<double>& L = s.L;
    for (int64_t i = s.first; i < s.last; ++i) {
        const int64_t n = L.at[i + 1] - L.at[i];
        double* own = s.X + 6 * (i - s.first);
        Six x = Six::load(own), scaled = {};
        for (int64_t k = 0; k < n; ++k) x.add(-L.rows[L.at[i] + k], Six::load(own + 6 * (k - n)));
        scaled.add(L.pivots[i], x);
        scaled.store(own);
    }
    for (int64_t i = s.last; i-- > s.first;) {
        const int64_t n = L.at[i + 1] - L.at[i];
        double* own = s.X + 6 * (i - s.first);
        Six scaled = {};
        scaled.add(L.pivots[i], Six::load(own));
        scaled.store(own);
        for (int64_t k = 0; k < n; ++k) {
            Six x = Six::load(own + 6 * (k - n));
            x.add(-L.rows[L.at[i] + k], scaled);
            x.store(own + 6 * (k - n));
        }
    }
}
KL_DISPATCH(substitute_six_some, substitute_six, double, const SixSubstitutions&)

// A partition of the nodes, and the factor of each part of a matrix.
class Clusters {
public:
    Ints of, starts, members;  // cluster of each node; nodes of each cluster in the order of its factor
    Skyline<double> exact;     // while setting up
    Skyline<float> factor;

    bool empty() const { return of.empty(); }
    int64_t count() const { return empty() ? 0 : static_cast<int64_t>(starts.size()) - 1; }
    int64_t bytes() const {
        return 4 * static_cast<int64_t>(of.size() + starts.size() + members.size() + factor.rows.size() +
                                        factor.pivots.size() + 2 * factor.at.size());
    }

    // f(first, last) for ranges of clusters of about as many nodes.
    template <class F>
    void over(int64_t nodes, const F& f) const {
        const int64_t all = static_cast<int64_t>(members.size());
        parallel_ranges(count(), std::max<int64_t>(1, nodes * count() / std::max<int64_t>(1, all)), f);
    }

    // Number the clusters by their labels and order the nodes of each for a small envelope.
    void collect(const Graph& g, const Ints& label) {
        of.assign(g.rows, -1);
        Ints number(g.rows, -1);
        int32_t found = 0;
        for (int64_t i = 0; i < g.rows; ++i) {
            int32_t& n = number[label[i]];
            if (n < 0) n = found++;
            of[i] = n;
        }
        starts.assign(found + 1, 0);
        for (int32_t c : of) ++starts[c + 1];
        std::partial_sum(starts.begin(), starts.end(), starts.begin());
        members.resize(g.rows);
        Ints next(starts.begin(), starts.end() - 1);
        for (int64_t i = 0; i < g.rows; ++i) members[next[of[i]]++] = static_cast<int32_t>(i);
        Ints place(g.rows);
        over(1024, [&](int64_t first, int64_t last) {
            for (int64_t c = first; c < last; ++c) arrange(g, c, place);
        });
    }

    // Nodes of the envelope of cluster c, where each node has its place.
    int64_t envelope(const Graph& g, int64_t c, Ints& place) const {
        int64_t sum = 0;
        for (int32_t p = starts[c]; p < starts[c + 1]; ++p) place[members[p]] = p;
        for (int32_t p = starts[c]; p < starts[c + 1]; ++p) sum += p - leftmost(g, p, place) + 1;
        return sum;
    }

    // Factorise the part of each cluster of A, of b x b blocks, where fixed components stand alone.
    void factorise(const Graph& g, const double* A, int b, const std::vector<uint8_t>& fixed) {
        Ints place(g.rows);
        for (int64_t p = 0; p < g.rows; ++p) place[members[p]] = static_cast<int32_t>(p);
        exact.at.assign(g.rows * b + 1, 0);
        for (int64_t p = 0; p < g.rows; ++p) {
            const int64_t before = p - leftmost(g, p, place);
            for (int r = 0; r < b; ++r) exact.at[p * b + r + 1] = exact.at[p * b + r] + before * b + r;
        }
        exact.rows.assign(exact.at.back(), 0.0);
        exact.pivots.assign(g.rows * b, 0.0);
        over(256, [&](int64_t first, int64_t last) {
            for (int64_t c = first; c < last; ++c) {
                for (int32_t p = starts[c]; p < starts[c + 1]; ++p) fill(g, A, b, fixed, place, p);
                factorise_some(Factor{exact, int64_t{starts[c]} * b, int64_t{starts[c + 1]} * b});
            }
        });
        factor.at = exact.at;
        factor.rows.assign(exact.rows.begin(), exact.rows.end());
        factor.pivots.assign(exact.pivots.begin(), exact.pivots.end());
    }

    // d = alpha d + beta D^-1 r and x = from + d, or from zero; x may be r.
    void step(int b, const float* r, const float* from, float* d, float* x, float alpha, float beta) const {
        over(1024, [&](int64_t first, int64_t last) {
            std::vector<float> z(static_cast<size_t>(starts[last] - starts[first]) * b);
            const int64_t start = starts[first];
            for (int64_t p = start; p < starts[last]; ++p)
                for (int c = 0; c < b; ++c) z[(p - start) * b + c] = r[int64_t{members[p]} * b + c];
            substitute_some(Substitution{factor, start * b, int64_t{starts[last]} * b, z.data()});
            for (int64_t p = start; p < starts[last]; ++p)
                for (int c = 0; c < b; ++c) {
                    const int64_t i = int64_t{members[p]} * b + c;
                    d[i] = (from ? alpha * d[i] : 0) + beta * z[(p - start) * b + c];
                    x[i] = (from ? from[i] : 0) + d[i];
                }
        });
    }

private:
    // The first place that a node of the same cluster linked to that at place p has.
    int64_t leftmost(const Graph& g, int64_t p, const Ints& place) const {
        const int32_t i = members[p];
        int64_t left = p;
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k)
            if (of[g.indices[k]] == of[i]) left = std::min<int64_t>(left, place[g.indices[k]]);
        return left;
    }

    // Take the order of a cluster's nodes that a search in breadth gives, if it is better than theirs.
    void arrange(const Graph& g, int64_t c, Ints& place) {
        const int32_t start = starts[c], size = starts[c + 1] - start;
        if (size < 3) return;
        const int64_t before = envelope(g, c, place);
        const Ints given(members.begin() + start, members.begin() + start + size);
        const Ints there = breadth(g, c, given[0], place);
        Ints found = breadth(g, c, there.back(), place);  // from one end to the other
        std::copy(found.rbegin(), found.rend(), members.begin() + start);
        if (envelope(g, c, place) >= before) std::copy(given.begin(), given.end(), members.begin() + start);
    }

    // Nodes of cluster c from one of them outwards; those without links to it come last.
    Ints breadth(const Graph& g, int64_t c, int32_t from, Ints& place) const {
        const Ints all(members.begin() + starts[c], members.begin() + starts[c + 1]);
        for (int32_t i : all) place[i] = -1;
        Ints found;
        for (int64_t next = -1; next < static_cast<int64_t>(all.size()); ++next) {
            const int32_t seed = next < 0 ? from : all[next];
            if (place[seed] >= 0) continue;
            place[seed] = 0;
            found.push_back(seed);
            for (size_t at = found.size() - 1; at < found.size(); ++at)
                for (int32_t k = g.indptr[found[at]]; k < g.indptr[found[at] + 1]; ++k) {
                    const int32_t j = g.indices[k];
                    if (of[j] != c || place[j] >= 0) continue;
                    place[j] = 0;
                    found.push_back(j);
                }
        }
        return found;
    }

    void fill(const Graph& g, const double* A, int b, const std::vector<uint8_t>& fixed, const Ints& place,
              int64_t p) {
        const int64_t i = members[p];
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k) {
            const int64_t j = g.indices[k], q = place[j];
            if (of[j] != of[i] || q > p) continue;
            for (int r = 0; r < b; ++r)
                for (int c = 0; c < b && q * b + c <= p * b + r; ++c) {
                    const double value = A[(k * int64_t{b} + r) * b + c];
                    const int64_t row = p * b + r, column = q * b + c;
                    if (row == column)
                        exact.pivots[row] = value;
                    else if (!fixed[i * b + r] && !fixed[j * b + c])
                        exact.rows[exact.at[row + 1] - (row - column)] = value;
                }
        }
    }
};

// Squared Frobenius norms of blocks.
inline double squared_norm(const double* block, int size) {
    double sum = 0;
    for (int e = 0; e < size; ++e) sum += block[e] * block[e];
    return sum;
}

inline std::vector<double> diagonal_norms(const Graph& g, const double* A, int size) {
    std::vector<double> norms(g.rows, 0.0);
    for (int64_t i = 0; i < g.rows; ++i)
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k)
            if (g.indices[k] == i) norms[i] = std::sqrt(squared_norm(A + int64_t{k} * size, size));
    return norms;
}

// Label nodes by the lowest node that links join them to; joins(i, k) says whether link k of i does.
template <class F>
Ints components(const Graph& g, const F& joins) {
    Ints label(g.rows);
    std::iota(label.begin(), label.end(), 0);
    const auto root = [&](int32_t i) {
        while (label[i] != i) i = label[i] = label[label[i]];
        return i;
    };
    for (int32_t i = 0; i < g.rows; ++i)
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k) {
            if (g.indices[k] >= i || !joins(i, k)) continue;
            const int32_t a = root(i), b = root(g.indices[k]);
            label[std::max(a, b)] = std::min(a, b);
        }
    for (int32_t i = 0; i < g.rows; ++i) label[i] = root(i);
    return label;
}

// Links of each node by length, and how many of each length each component has.
struct Lengths {
    std::vector<uint8_t> near;
    Ints label, size, far, between;
};

inline Lengths lengths(const Graph& g, const double* X) {
    Lengths out;
    std::vector<double> least(g.rows);
    parallel_ranges(g.rows, ROW_GRAIN, [&](int64_t first, int64_t last) {
        for (int64_t i = first; i < last; ++i) least[i] = extent(g, X, i).first;
    });
    const auto ratio = [&](int64_t i, int32_t k) {
        const int32_t j = g.indices[k];
        return squared_distance(X, i, j) / std::fmin(least[i], least[j]);
    };
    out.near.resize(g.indptr[g.rows]);
    parallel_ranges(g.rows, ROW_GRAIN, [&](int64_t first, int64_t last) {
        for (int64_t i = first; i < last; ++i)
            for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k) out.near[k] = ratio(i, k) <= NEAR;
    });
    out.label = components(g, [&](int32_t, int32_t k) { return out.near[k]; });
    for (Ints* counts : {&out.size, &out.far, &out.between}) counts->assign(g.rows, 0);
    for (int64_t i = 0; i < g.rows; ++i) {
        const int32_t c = out.label[i];
        ++out.size[c];
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k)
            if (!out.near[k]) ++(ratio(i, k) > FAR ? out.far : out.between)[c];
    }
    return out;
}

// The clusters of a mesh with nodes at X (n, 3), not factorised; none unless most nodes belong to
// clusters that a gap sets apart from the links between them, and that are cheap to factorise.
inline Clusters find_clusters(const Graph& g, const double* A, int b, const double* X, double theta) {
    if (!looks_stretched(g, X)) return {};
    const Lengths links = lengths(g, X);
    Ints label(g.rows);
    int64_t apart = 0;
    for (int32_t i = 0; i < g.rows; ++i) {
        const int32_t c = links.label[i];
        const bool gap = links.size[c] > 1 && links.far[c] >= links.size[c] &&
                         links.between[c] <= BETWEEN * links.far[c];
        label[i] = gap ? c : i;
        apart += gap;
    }
    if (2 * apart < g.rows) return {};
    Clusters found;
    found.collect(g, label);
    Ints place(g.rows);
    std::vector<uint8_t> cheap(found.count());
    int64_t joined = 0;
    for (int64_t c = 0; c < found.count(); ++c) {
        int64_t blocks = 0;
        for (int32_t p = found.starts[c]; p < found.starts[c + 1]; ++p)
            blocks += g.indptr[found.members[p] + 1] - g.indptr[found.members[p]];
        const int32_t size = found.starts[c + 1] - found.starts[c];
        cheap[c] = size > 1 && found.envelope(g, c, place) <= FILL * blocks;
        joined += cheap[c] ? size : 0;
    }
    if (2 * joined < g.rows) return {};
    const std::vector<double> own = diagonal_norms(g, A, b * b);
    label = components(g, [&](int32_t i, int32_t k) {  // unlike materials part them
        const int32_t j = g.indices[k];
        return links.near[k] && found.of[i] == found.of[j] && cheap[found.of[i]] &&
               squared_norm(A + int64_t{k} * b * b, b * b) >= theta * theta * own[i] * own[j];
    });
    found.collect(g, label);
    return found;
}

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
