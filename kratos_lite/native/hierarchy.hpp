// The multigrid hierarchy: set-up, V-cycle, and conjugate gradients around it.

#pragma once
#include <deque>
#include <functional>

#include "cluster_transfer.hpp"
#include "level.hpp"

namespace kl {

// From a level to the next coarser one: blocks b x 6 of smoothed aggregation, or one weight for each
// pair of nodes (linear elements within quadratic ones).
struct Transfer {
    Ints indptr, indices;
    Floats data;
    Transposed columns;
    bool weights = false;
    std::vector<uint8_t> fine_fixed, coarse_fixed;  // components that weights must not touch

    int64_t bytes() const {
        return 4 * static_cast<int64_t>(indptr.size() + indices.size() + data.size() + columns.indptr.size() +
                                        columns.rows.size() + columns.places.size());
    }

    void restrict_to(const Level& fine, const Floats& from, const Level& coarse, Floats& to) const;
    void prolong(const Level& coarse, const Floats& from, const Level& fine, Floats& to) const;
};

// Some rows of a transfer: to = P^T from (coarse rows), or to += P from (fine rows).
template <int b>
struct Move {
    const Transfer& P;
    const float* from;
    float* to;
    int64_t first, last;
};

typedef vec<float, 8> Modes;  // six modes; the last two lanes hold what is not used

template <int b>
KL_INLINE void restrict_rows(const Move<b>& m) {
    const Transposed& columns = m.P.columns;
    for (int64_t I = m.first; I < m.last; ++I) {
        Modes even = {}, odd = {};
        for (int32_t k = columns.indptr[I]; k < columns.indptr[I + 1]; ++k) {
            const float* r = m.from + static_cast<int64_t>(columns.rows[k]) * b;
            const float* p = &m.P.data[static_cast<int64_t>(columns.places[k]) * b * MODES];
            for (int j = 0; j < b; ++j)
                (j % 2 ? odd : even) += *reinterpret_cast<const Modes*>(p + j * MODES) * r[j];
        }
        const Modes sum = even + odd;
        for (int c = 0; c < MODES; ++c) m.to[I * MODES + c] = sum[c];
    }
}

template <int b>
KL_INLINE void prolong_rows(const Move<b>& m) {
    for (int64_t i = m.first; i < m.last; ++i) {
        Modes sum[b] = {};
        for (int32_t k = m.P.indptr[i]; k < m.P.indptr[i + 1]; ++k) {
            const Modes x = *reinterpret_cast<const Modes*>(m.from + static_cast<int64_t>(m.P.indices[k]) * MODES);
            const float* p = &m.P.data[static_cast<int64_t>(k) * b * MODES];
            for (int j = 0; j < b; ++j) sum[j] += *reinterpret_cast<const Modes*>(p + j * MODES) * x;
        }
        for (int j = 0; j < b; ++j) {
            const Modes s = sum[j];
            m.to[i * b + j] += (s[0] + s[1]) + (s[2] + s[3]) + (s[4] + s[5]);
        }
    }
}

template <int V>
KL_INLINE void restrict_rows_3(const Move<3>& m) { restrict_rows<3>(m); }
template <int V>
KL_INLINE void restrict_rows_6(const Move<6>& m) { restrict_rows<6>(m); }
template <int V>
KL_INLINE void prolong_rows_3(const Move<3>& m) { prolong_rows<3>(m); }
template <int V>
KL_INLINE void prolong_rows_6(const Move<6>& m) { prolong_rows<6>(m); }
KL_DISPATCH(restrict_some, restrict_rows_3, float, const Move<3>&)
KL_DISPATCH(restrict_some, restrict_rows_6, float, const Move<6>&)
KL_DISPATCH(prolong_some, prolong_rows_3, float, const Move<3>&)
KL_DISPATCH(prolong_some, prolong_rows_6, float, const Move<6>&)

// coarse = P^T fine
inline void Transfer::restrict_to(const Level& fine, const Floats& from, const Level& coarse, Floats& to) const {
    parallel_ranges(coarse.n, 64, [&](int64_t first, int64_t last) {
        if (!weights && fine.b == 3) return restrict_some(Move<3>{*this, from.data(), to.data(), first, last});
        if (!weights) return restrict_some(Move<6>{*this, from.data(), to.data(), first, last});
        for (int64_t I = first; I < last; ++I) {
            float sum[3] = {};
            for (int32_t k = columns.indptr[I]; k < columns.indptr[I + 1]; ++k)
                for (int c = 0; c < 3; ++c)
                    sum[c] += data[columns.places[k]] * from[3 * static_cast<int64_t>(columns.rows[k]) + c];
            for (int c = 0; c < 3; ++c) to[3 * I + c] = coarse_fixed[3 * I + c] ? 0.0f : sum[c];
        }
    });
}

// fine += P coarse
inline void Transfer::prolong(const Level&, const Floats& from, const Level& fine, Floats& to) const {
    parallel_ranges(fine.n, 1024, [&](int64_t first, int64_t last) {
        if (!weights && fine.b == 3) return prolong_some(Move<3>{*this, from.data(), to.data(), first, last});
        if (!weights) return prolong_some(Move<6>{*this, from.data(), to.data(), first, last});
        for (int64_t i = first; i < last; ++i) {
            float sum[3] = {};
            for (int32_t k = indptr[i]; k < indptr[i + 1]; ++k)
                for (int c = 0; c < 3; ++c) sum[c] += data[k] * from[3 * static_cast<int64_t>(indices[k]) + c];
            for (int c = 0; c < 3; ++c)
                if (!fine_fixed[3 * i + c]) to[3 * i + c] += sum[c];
        }
    });
}

struct Settings {
    int degree = 2;         // of the Chebyshev smoother
    float ratio = 12;       // largest to smallest eigenvalue that it smooths
    double theta = 0;       // links weaker than theta sqrt(|A_ii| |A_jj|) do not aggregate
    int64_t full = 300;     // unknowns of the coarsest level
};

class Hierarchy {
public:
    explicit Hierarchy(const Settings& settings) : settings(settings) {}

    // The finest level of 3x3 blocks, with nodes at points (n, 3); and, for quadratic elements, the
    // linear level below it.
    void add_nodal(const Graph& g, const double* data, const std::vector<uint8_t>& fixed,
                   std::vector<double> points) {
        levels.emplace_back();
        X = std::move(points);
        inverse = levels.back().take(g, data, fixed, 3);
        levels.back().cluster(data, fixed, X.data(), settings.theta);
        levels.back().largest = largest_eigenvalue(levels.back());
    }

    // The linear level of quadratic elements below the level that is last: weights (n, m) from its
    // nodes to all.
    void add_linear(const Graph& g, const double* data, std::vector<uint8_t> fixed, Transfer transfer,
                    const std::vector<uint8_t>& fine_fixed, std::vector<double> points) {
        levels.back().clusters.exact = {};
        transfer.weights = true;
        transfer.fine_fixed = fine_fixed;
        transfer.coarse_fixed = fixed;
        transfer.columns = Transposed(g.rows, transfer.indptr, transfer.indices);
        transfers.push_back(std::move(transfer));
        add_nodal(g, data, fixed, std::move(points));
    }

    // Coarsen the last level, of blocks `data`, by smoothed aggregation until little is left.
    // B (n, 3, 6) are its rigid modes, zero at fixed components.
    void coarsen(const double* data, std::vector<uint8_t> fixed, std::vector<double> B) {
        CoarseMatrix matrix;
        Graph graph = levels.back().graph;
        while (true) {
            Level& fine = levels.back();
            if (fine.size() <= settings.full || levels.size() > 20) break;
            std::vector<double> R;
            CoarseMatrix next;
            const int64_t count = fine.b == 3 ? add_transfer<3>(graph, data, fixed, B, R, next)
                                              : add_transfer<6>(graph, data, fixed, B, R, next);
            if (count == 0) break;
            matrix = std::move(next);
            data = matrix.data.data();
            B.swap(R);
            levels.emplace_back();
            Level& coarse = levels.back();
            coarse.own_indptr = matrix.indptr;
            coarse.own_indices = matrix.indices;
            graph = {count, coarse.own_indptr.data(), coarse.own_indices.data()};
            fixed.assign(count * MODES, 0);
            inverse = coarse.take(graph, data, fixed, MODES);
            coarse.cluster(data, fixed, X.data(), settings.theta);
            coarse.largest = largest_eigenvalue(coarse);
        }
        factorise(data, fixed);
        inverse.clear();
        inverse.shrink_to_fit();
        levels.back().clusters.exact = {};
    }

    // z = M r, the V-cycle on a right side of any size.
    void cycle(const double* r, double* z) {
        Level& top = levels.front();
        double norm = 0;
        for (int64_t i = 0; i < top.size(); ++i) norm = std::fmax(norm, std::fabs(r[i]));
        if (norm == 0) {
            std::fill(z, z + top.size(), 0.0);
            return;
        }
        parallel_ranges(top.size(), VECTOR_GRAIN, [&](int64_t first, int64_t last) {
            for (int64_t i = first; i < last; ++i) top.c[i] = static_cast<float>(r[i] / norm);
        });
        descend(0);
        parallel_ranges(top.size(), VECTOR_GRAIN, [&](int64_t first, int64_t last) {
            for (int64_t i = first; i < last; ++i) z[i] = norm * top.x[i];
        });
    }

    double complexity() const {
        double all = 0;
        for (const Level& level : levels) all += static_cast<double>(level.A.size());
        return all / static_cast<double>(levels.front().A.size());
    }

    int64_t bytes() const {
        int64_t all = 0;
        for (const Level& level : levels) all += level.bytes();
        for (const Transfer& transfer : transfers) all += transfer.bytes();
        return all;
    }

    std::deque<Level> levels;
    std::deque<Transfer> transfers;

private:
    void descend(size_t l) {
        Level& level = levels[l];
        if (l + 1 == levels.size()) {
            solve_coarsest(level);
            return;
        }
        Level& coarse = levels[l + 1];
        level.smooth(settings.degree, settings.ratio, true);
        level.residual(level.y);
        transfers[l].restrict_to(level, level.y, coarse, coarse.c);
        descend(l + 1);
        transfers[l].prolong(coarse, coarse.x, level, level.x);
        level.smooth(settings.degree, settings.ratio, false);
    }

    void solve_coarsest(Level& level) {
        if (level.size() > FULL_LIMIT) {  // aggregation came to a halt: smooth well instead
            level.smooth(20, 400, true);
            return;
        }
        std::vector<double> x(level.c.begin(), level.c.begin() + level.size());
        coarsest.solve(x.data());
        for (int64_t i = 0; i < level.size(); ++i) level.x[i] = static_cast<float>(x[i]);
    }

    void factorise(const double* data, const std::vector<uint8_t>& fixed) {
        const Level& level = levels.back();
        const int64_t N = level.size(), b = level.b;
        if (N > FULL_LIMIT) return;
        std::vector<double> full(N * N, 0.0);
        for (int64_t i = 0; i < level.n; ++i)
            for (int32_t k = level.graph.indptr[i]; k < level.graph.indptr[i + 1]; ++k)
                for (int64_t r = 0; r < b; ++r)
                    for (int64_t c = 0; c < b; ++c) {
                        const int64_t row = i * b + r, column = level.graph.indices[k] * b + c;
                        if (row == column || !(fixed[row] || fixed[column]))
                            full[row * N + column] = data[(k * b + r) * b + c];
                    }
        coarsest = Cholesky(std::move(full), N);
    }

    std::vector<uint8_t> strong_links(const Graph& g, const double* data, int size) const {
        if (settings.theta == 0) return {};
        std::vector<double> norm(g.indptr[g.rows]), diagonal(g.rows);
        for (int64_t i = 0; i < g.rows; ++i)
            for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k) {
                double sum = 0;
                for (int e = 0; e < size; ++e) sum += data[k * int64_t{size} + e] * data[k * int64_t{size} + e];
                norm[k] = std::sqrt(sum);
                if (g.indices[k] == i) diagonal[i] = norm[k];
            }
        std::vector<uint8_t> strong(norm.size());
        for (int64_t i = 0; i < g.rows; ++i)
            for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k)
                strong[k] = g.indices[k] == i ||
                            norm[k] >= settings.theta * std::sqrt(diagonal[i] * diagonal[g.indices[k]]);
        return strong;
    }

    // The middle of each aggregate.
    static std::vector<double> middles(const std::vector<double>& X, const Ints& of, int32_t count) {
        std::vector<double> sum(3 * static_cast<size_t>(count), 0.0), nodes(count, 0.0);
        for (size_t i = 0; i < of.size(); ++i) {
            if (of[i] < 0) continue;
            nodes[of[i]] += 1;
            for (int c = 0; c < 3; ++c) sum[3 * static_cast<size_t>(of[i]) + c] += X[3 * i + c];
        }
        for (size_t e = 0; e < sum.size(); ++e) sum[e] /= nodes[e / 3];
        return sum;
    }

    // Aggregate, smooth and multiply; returns the number of coarse nodes, or 0 if nothing is gained.
    template <int b>
    int64_t add_transfer(const Graph& g, const double* data, const std::vector<uint8_t>& fixed,
                         std::vector<double>& B, std::vector<double>& R, CoarseMatrix& next) {
        std::vector<uint8_t> apart(g.rows);
        for (int64_t i = 0; i < g.rows; ++i) {
            apart[i] = 1;
            for (int c = 0; c < b; ++c) apart[i] &= fixed[i * b + c];
        }
        const std::vector<uint8_t> strong = strong_links(g, data, b * b);
        Ints of;
        Clusters& clusters = levels.back().clusters;
        const int32_t count = clusters.empty() ? aggregate(g, apart, strong, of)
                                               : aggregate_clusters<b>(g, data, clusters, apart, strong, of);
        if (count == 0 || count * MODES > 0.9 * b * g.rows) return 0;
        orthonormalise<b>(of, count, B, R);
        const double omega = 4.0 / 3.0 / levels.back().largest;
        Prolongator P = clusters.empty()
                            ? smoothed_prolongator<b>(g, data, inverse.data(), fixed, of, B, omega)
                            : smoothed_prolongator<b>(g, data, clusters, fixed, of, B, omega);
        clusters.exact = {};
        X = middles(X, of, count);
        Transposed columns(count, P.indptr, P.indices);
        next = galerkin<b>(g, data, P, columns, count);
        transfers.emplace_back();
        Transfer& t = transfers.back();
        t.data = std::move(P.data);
        t.indptr = std::move(P.indptr);
        t.indices = std::move(P.indices);
        t.columns = std::move(columns);
        return count;
    }

    static constexpr int64_t FULL_LIMIT = 1500;
    Settings settings;
    Cholesky coarsest;
    std::vector<double> inverse;  // D^-1 of the last level, while setting up
    std::vector<double> X;        // nodes of the last level
};

inline double dot(const double* x, const double* y, int64_t n) {
    constexpr int64_t CHUNK = 8192;
    std::vector<double> parts((n + CHUNK - 1) / CHUNK);
    parallel_ranges(n, CHUNK, [&](int64_t first, int64_t last) {
        double sum = 0;
        for (int64_t i = first; i < last; ++i) sum += x[i] * y[i];
        parts[first / CHUNK] = sum;
    });
    double sum = 0;
    for (double part : parts) sum += part;
    return sum;
}

struct Outcome {
    int iterations;
    bool converged;
};

constexpr int STALLED = 200;  // iterations without a new smallest residual; thin elements make plateaus

// Conjugate gradients on A x = b with the V-cycle; A's rows at fixed components are left out.
// Source: Saad, Iterative Methods for Sparse Linear Systems (2003), algorithm 9.1.
inline Outcome conjugate_gradients(const Blocks<double>& A, const std::vector<uint8_t>& fixed, Hierarchy& M,
                                   const double* b, double* x, double tolerance, double norm_A, int most,
                                   const std::function<bool(double)>& each) {
    const int64_t n = 3 * A.rows;
    std::vector<double> r(b, b + n), z(n), p(n), Ap(n);
    std::fill(x, x + n, 0.0);
    const double norm_b = std::sqrt(dot(b, b, n));
    if (norm_b == 0) return {0, true};
    M.cycle(r.data(), z.data());
    p = z;
    double rz = dot(r.data(), z.data(), n), best = INFINITY;  // residuals may grow at first
    int best_at = 0;
    for (int k = 1; k <= most; ++k) {
        multiply(A, p.data(), Ap.data());
        parallel_ranges(n, VECTOR_GRAIN, [&](int64_t first, int64_t last) {
            for (int64_t i = first; i < last; ++i)
                if (fixed[i]) Ap[i] = 0;
        });
        const double curvature = dot(p.data(), Ap.data(), n);
        if (!(curvature > 0 && rz > 0)) return {k, false};
        const double alpha = rz / curvature;
        parallel_ranges(n, VECTOR_GRAIN, [&](int64_t first, int64_t last) {
            for (int64_t i = first; i < last; ++i) {
                x[i] += alpha * p[i];
                r[i] -= alpha * Ap[i];
            }
        });
        const double norm = std::sqrt(dot(r.data(), r.data(), n));
        if (!each(norm / norm_b)) return {k, false};
        const double floor = 2 * 2.2e-16 * (norm_A * std::sqrt(dot(x, x, n)) + norm_b);
        if (norm <= std::fmax(tolerance * norm_b, floor)) return {k, true};
        if (norm < best) {
            best = norm;
            best_at = k;
        } else if (k - best_at > STALLED) {
            return {k, false};
        }
        M.cycle(r.data(), z.data());
        const double old = rz;
        rz = dot(r.data(), z.data(), n);
        const double beta = rz / old;
        parallel_ranges(n, VECTOR_GRAIN, [&](int64_t first, int64_t last) {
            for (int64_t i = first; i < last; ++i) p[i] = z[i] + beta * p[i];
        });
    }
    return {most, false};
}

}  // namespace kl
