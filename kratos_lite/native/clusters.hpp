// Clusters of nodes close together on a stretched mesh (lines across thin elements, planes across
// long ones).  Stiffness couples their nodes far more than others, so that only a smoother which
// solves each cluster exactly, and aggregates of whole clusters, serve conjugate gradients there; or,
// where clusters are too large to be solved, aggregates of nodes within each of them alone.
//
// Source of block smoothing along strong couplings, and of coarsening along them alone: Trottenberg,
// Oosterlee & Schüller, Multigrid (2001), section 5.1.  The tests on distances are our own.

#pragma once
#include <cmath>

#include "aggregation.hpp"
#include "skyline.hpp"

namespace kl {

using Floats = std::vector<float>;

constexpr double NEAR = 9, FAR = 16;     // squares of distances, to that of the nearest node
constexpr double COARSE_FAR = 12.5;      // the same where close nodes alone have aggregated
constexpr double BETWEEN = 0.1;          // of as many far links, at most so many neither near nor far
constexpr double FILL = 1;               // nodes in the envelopes of clusters, to their blocks in A
constexpr double CONTRAST = 1e3;           // largest stiffness of one node to that of another
constexpr double EXTREME = 2500;         // the same of few nodes, which alone stall a smoother of single nodes
constexpr int64_t SAMPLE = 2000;         // nodes that show whether a mesh is stretched

inline double squared_distance(const double* X, int64_t i, int64_t j) {
    double sum = 0;
    for (int c = 0; c < 3; ++c) sum += (X[3 * i + c] - X[3 * j + c]) * (X[3 * i + c] - X[3 * j + c]);
    return sum;
}

// Squares of the distances to the nearest and to the farthest linked node; nodes at the same point
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

struct Stretch {
    bool common, extreme;  // one of twenty nodes has both near and far ones; one of 100 has extremely near ones
};

// Of some nodes all over the mesh, at places that no order of the nodes repeats.
inline Stretch stretch_of(const Graph& g, const double* X, double far) {
    const int64_t seen = std::min(g.rows, SAMPLE);
    int64_t stretched = 0, extreme = 0;
    for (int64_t s = 0; s < seen; ++s) {
        const double share = std::fmod(0.6180339887498949 * static_cast<double>(s), 1.0);  // golden section
        const int64_t i = g.rows <= SAMPLE ? s : static_cast<int64_t>(share * static_cast<double>(g.rows));
        const auto [low, high] = extent(g, X, i);
        stretched += high > far * low;
        extreme += high > EXTREME * low;
    }
    return {20 * stretched > seen, 100 * extreme > seen};
}

// A partition of the nodes, and the factor of each part of a matrix.
class Clusters {
public:
    Ints of, starts, members;  // cluster of each node; nodes of each cluster in the order of its factor
    Bytes near;                // links that aggregate, where there are no clusters as they would be too large
    Skyline<double> exact;     // while setting up
    Skyline<float> factor;

    bool empty() const { return of.empty(); }
    void forget() {
        exact = {};
        near = {};
    }
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
        members_of(of, found, starts, members);
        Ints position(g.rows);
        over(1024, [&](int64_t first, int64_t last) {
            for (int64_t c = first; c < last; ++c) reorder(g, c, position);
        });
    }

    // Nodes of the envelope of cluster c, with the position of each node.
    int64_t envelope(const Graph& g, int64_t c, Ints& position) const {
        int64_t sum = 0;
        for (int32_t p = starts[c]; p < starts[c + 1]; ++p) position[members[p]] = p;
        for (int32_t p = starts[c]; p < starts[c + 1]; ++p) sum += p - leftmost(g, p, position) + 1;
        return sum;
    }

    // Factorize the part of each cluster of A, of b x b blocks, where fixed components stand alone; `links`
    // gives the block of each entry of the graph if it is not that of A.
    void factorize(const Graph& g, const double* A, int b, const Bytes& fixed, const int32_t* links = nullptr) {
        Ints position(g.rows);
        for (int64_t p = 0; p < g.rows; ++p) position[members[p]] = static_cast<int32_t>(p);
        exact.at.assign(g.rows * b + 1, 0);
        for (int64_t p = 0; p < g.rows; ++p) {
            const int64_t before = p - leftmost(g, p, position);
            for (int r = 0; r < b; ++r) exact.at[p * b + r + 1] = exact.at[p * b + r] + before * b + r;
        }
        exact.rows.assign(exact.at.back(), 0.0);
        exact.pivots.assign(g.rows * b, 0.0);
        over(256, [&](int64_t first, int64_t last) {
            for (int64_t c = first; c < last; ++c) {
                for (int32_t p = starts[c]; p < starts[c + 1]; ++p) fill(g, A, b, fixed, links, position, p);
                const int64_t from = int64_t{starts[c]} * b, to = int64_t{starts[c + 1]} * b;
                dispatch<double>([&](auto V) KL_INLINE_LAMBDA { factorize_rows<V>(exact, from, to); });
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
            const int64_t end = int64_t{starts[last]} * b;
            dispatch<float>([&](auto V) KL_INLINE_LAMBDA { substitute_rows<V>(factor, start * b, end, z.data()); });
            for (int64_t p = start; p < starts[last]; ++p)
                for (int c = 0; c < b; ++c) {
                    const int64_t i = int64_t{members[p]} * b + c;
                    d[i] = (from ? alpha * d[i] : 0) + beta * z[(p - start) * b + c];
                    x[i] = (from ? from[i] : 0) + d[i];
                }
        });
    }

private:
    // The first position of a node of the same cluster linked to that at position p.
    int64_t leftmost(const Graph& g, int64_t p, const Ints& position) const {
        const int32_t i = members[p];
        int64_t left = p;
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k)
            if (of[g.indices[k]] == of[i]) left = std::min<int64_t>(left, position[g.indices[k]]);
        return left;
    }

    // Take the order of a cluster's nodes that a breadth-first search gives, if it is better than theirs.
    void reorder(const Graph& g, int64_t c, Ints& position) {
        const int32_t start = starts[c], size = starts[c + 1] - start;
        if (size < 3) return;
        const int64_t before = envelope(g, c, position);
        const Ints original(members.begin() + start, members.begin() + start + size);
        const Ints outwards = breadth_first(g, c, original[0], position);
        Ints found = breadth_first(g, c, outwards.back(), position);  // from one end to the other
        std::copy(found.rbegin(), found.rend(), members.begin() + start);
        if (envelope(g, c, position) >= before) std::copy(original.begin(), original.end(), members.begin() + start);
    }

    // Nodes of cluster c from one of them outwards; those without links to it come last.
    Ints breadth_first(const Graph& g, int64_t c, int32_t from, Ints& position) const {
        const Ints all(members.begin() + starts[c], members.begin() + starts[c + 1]);
        for (int32_t i : all) position[i] = -1;
        Ints found;
        for (int64_t next = -1; next < static_cast<int64_t>(all.size()); ++next) {
            const int32_t seed = next < 0 ? from : all[next];
            if (position[seed] >= 0) continue;
            position[seed] = 0;
            found.push_back(seed);
            for (size_t at = found.size() - 1; at < found.size(); ++at)
                for (int32_t k = g.indptr[found[at]]; k < g.indptr[found[at] + 1]; ++k) {
                    const int32_t j = g.indices[k];
                    if (of[j] != c || position[j] >= 0) continue;
                    position[j] = 0;
                    found.push_back(j);
                }
        }
        return found;
    }

    void fill(const Graph& g, const double* A, int b, const Bytes& fixed, const int32_t* links, const Ints& position,
              int64_t p) {
        const int64_t i = members[p];
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k) {
            const int64_t j = g.indices[k], q = position[j];
            if (of[j] != of[i] || q > p) continue;
            for (int r = 0; r < b; ++r)
                for (int c = 0; c < b && q * b + c <= p * b + r; ++c) {
                    const double value = A[((links ? links[k] : k) * int64_t{b} + r) * b + c];
                    const int64_t row = p * b + r, column = q * b + c;
                    if (row == column)
                        exact.pivots[row] = value;
                    else if (!fixed[i * b + r] && !fixed[j * b + c])
                        exact.rows[exact.at[row + 1] - (row - column)] = value;
                }
        }
    }
};

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

// Links of each node by length, and how many of each length leave each component.
struct Lengths {
    Bytes near;
    Ints label, size, far, between;
};

inline Lengths lengths(const Graph& g, const double* X, double far) {
    Lengths out;
    Doubles least(g.rows);
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
            if (out.label[g.indices[k]] != c) ++(ratio(i, k) > far ? out.far : out.between)[c];
    }
    return out;
}

// Does each second node have fixed components, as in plane strain?  Rigid modes tell two such planes apart.
inline bool are_held(const Bytes& fixed, int b) {
    int64_t held = 0;
    for (size_t i = 0; i < fixed.size(); i += b) held += std::any_of(&fixed[i], &fixed[i] + b, [](uint8_t f) { return f; });
    return 2 * b * held > static_cast<int64_t>(fixed.size());
}

// The clusters of a mesh with nodes at X (n, 3), not factorized; none unless most nodes, or a few where
// some are extremely near, belong to clusters that a gap sets apart from the links between them, and near
// links alone unless these are cheap to factorize.
inline Clusters find_clusters(const Graph& g, const double* A, int b, const Bytes& fixed, const double* X,
                              double theta, double far) {
    const Stretch stretch = stretch_of(g, X, far);
    if (!stretch.common && !stretch.extreme) return {};
    const Lengths links = lengths(g, X, far);
    Ints label(g.rows);
    int64_t clustered = 0;
    for (int32_t i = 0; i < g.rows; ++i) {
        const int32_t c = links.label[i];
        const bool gap = links.size[c] > 1 && links.far[c] >= links.size[c] &&
                         links.between[c] <= BETWEEN * links.far[c];
        label[i] = gap ? c : i;
        clustered += gap;
    }
    const bool most = 2 * clustered >= g.rows;
    if (clustered == 0 || !(most || stretch.extreme)) return {};
    Clusters found;
    found.collect(g, label);
    Ints position(g.rows);
    int64_t envelope = 0, blocks = 0, several = 0;
    for (int64_t c = 0; c < found.count(); ++c) {
        if (found.starts[c + 1] - found.starts[c] == 1) continue;
        ++several;
        envelope += found.envelope(g, c, position);
        for (int32_t p = found.starts[c]; p < found.starts[c + 1]; ++p)
            blocks += g.indptr[found.members[p] + 1] - g.indptr[found.members[p]];
    }
    if (envelope > FILL * blocks) {
        Clusters none;
        if (most && (several > 2 || !are_held(fixed, b))) none.near = links.near;
        return none;
    }
    const Doubles own = diagonal_norms(g, A, b * b);
    label = components(g, [&](int32_t i, int32_t k) {  // a stiffness contrast parts them
        const int32_t j = g.indices[k];
        return links.near[k] && found.of[i] == found.of[j] &&
               squared_norm(A + int64_t{k} * b * b, b * b) >= theta * theta * own[i] * own[j];
    });
    found.collect(g, label);
    return found;
}

}  // namespace kl
