// The multigrid hierarchy: set-up and V-cycle.

#pragma once
#include <deque>

#include "transfer.hpp"

namespace kl {

struct Settings {
    int degree = 2;         // of the Chebyshev smoother
    float ratio = 12;       // largest to smallest eigenvalue that it smooths
    double theta = 0;       // links weaker than theta sqrt(|A_ii| |A_jj|) do not aggregate
    int thin = 0;           // 1 for a thin body, 2 for a very thin flat one: see Level
    int64_t full = 300;     // unknowns of the coarsest level
};

class Hierarchy {
public:
    explicit Hierarchy(const Settings& settings) : settings(settings) {}

    // The finest level of 3x3 blocks, with nodes at points (n, 3); and, for quadratic elements, the
    // linear level below it.
    void add_nodal(const Graph& g, const double* data, const Bytes& fixed, Doubles points) {
        Level& level = add_level();
        X = std::move(points);
        inverse = level.set_matrix(g, data, fixed, 3, settings.thin > 1);
        level.cluster(data, fixed, X.data(), settings.theta, FAR);
        level.largest = largest_eigenvalue(level);
    }

    // The finest level without a matrix, with nodes at points (n, 3).
    void add_elements(const MatrixFree& product, const Bytes& fixed, Doubles points) {
        X = std::move(points);
        add_shared(nullptr, [&](Level& level) { return level.set_elements(product, fixed, product.n); });
    }

    // A level that ranks may share, without clusters; set(level) makes it and returns D^-1.
    template <class F>
    void add_shared(std::shared_ptr<const Halo> halo, const F& set, uint32_t noise = 0) {
        Level& level = add_level();
        if (halo) level.halo = std::move(halo);
        level.noise += noise;
        inverse = set(level);
        level.largest = largest_eigenvalue(level);
    }

    // The linear level of quadratic elements below the level that is last: weights (n, m) from its
    // nodes to all.
    void add_linear(const Graph& g, const double* data, const Bytes& fixed, Transfer transfer, Doubles points) {
        levels.back().clusters.forget();
        transfers.push_back(std::move(transfer));
        add_nodal(g, data, fixed, std::move(points));
    }

    // A level of nodes of six unknowns below the finest one of a thin body, P from it, and aggregates below that,
    // where overlapping parts smooth.
    void coarsen_plate(const double* data, Prolongator P, int32_t nodes, Doubles B) {
        Level& fine = levels.back();
        fine.clusters.exact = {};
        fine.thin = true;
        X.clear();
        settings.thin = std::max(settings.thin, 1);
        const Transfer& t = transfers.emplace_back(std::move(P), nodes);
        const CoarseMatrix plate = galerkin(3, fine.graph, data, t.P, t.columns, nodes);
        const Bytes fixed(int64_t{nodes} * MODES, 0);
        Level& coarse = add_coarse(plate, fixed);
        coarse.largest = largest_eigenvalue(coarse);
        patched = true;
        coarsen(coarse.graph, plate.data.data(), fixed, std::move(B));
    }

    // Whether the last level is small enough to be the coarsest.
    bool is_small() const { return levels.back().size() <= settings.full; }

    // Coarsen the last level, of blocks `data`, by smoothed aggregation until little is left.
    // B (n, 3, 6 sets) are its rigid modes and others that take little energy, zero at fixed components.  With
    // `ties`, which the level has worked in, `data` are without them: aggregates stay small.
    void coarsen(Graph graph, const double* data, Bytes fixed, Doubles B, const Ties* ties = nullptr) {
        sets = static_cast<int>(B.size() / (fixed.size() * MODES));
        CoarseMatrix matrix;
        if (levels.back().elements) levels.back().graph = graph;
        if (ties) ties->fill_rows(B, MODES * sets);
        if (ties && !levels.back().elements)
            levels.back().clusters.near = find_clusters(graph, data, 3, fixed, X.data(), settings.theta, FAR).near;
        while (true) {
            Level& fine = levels.back();
            if (is_small() || levels.size() > 20) break;
            Doubles R;
            CoarseMatrix next;
            bool planes = !fine.clusters.near.empty();
            const Doubles kept = planes || sets > 1 ? B : Doubles();
            const auto is_large = [&](double share) { return next.data.size() > share * fine.numbers(); };
            int64_t count = add_transfer(graph, data, fixed, ties, B, R, next);
            if (count && planes && is_large(LARGEST_PLANES)) {
                transfers.pop_back();
                fine.clusters.near = {};
                planes = false;
                B = kept;
                count = add_transfer(graph, data, fixed, ties, B, R, next);
            }
            if (count && sets > 1 && is_large(LARGEST_SETS)) {
                transfers.pop_back();
                B = first_columns(kept, MODES * sets);
                sets = 1;
                count = add_transfer(graph, data, fixed, ties, B, R, next);
            }
            fine.clusters.forget();
            if (count == 0) break;
            patched = patched || shears(graph, data, fixed, static_cast<int32_t>(count / sets));
            if (patched) {
                fine.patches = Patches(graph, data, fine.b, fixed, aggregates, static_cast<int32_t>(count / sets));
                if (!fine.patches.empty()) fine.largest = largest_eigenvalue(fine);
            }
            matrix = std::move(next);
            data = matrix.data.data();
            ties = nullptr;
            B.swap(R);
            X = centroids(X, aggregates, static_cast<int32_t>(count / sets), sets);
            fixed.assign(count * MODES, 0);
            Level& coarse = add_coarse(matrix, fixed);
            graph = coarse.graph;
            if (sets > 1)
                coarse.cluster_equally(data, fixed, sets);
            else if (!X.empty())
                coarse.cluster(data, fixed, X.data(), settings.theta, planes ? COARSE_FAR : FAR);
            coarse.largest = largest_eigenvalue(coarse);
        }
        if (!ties) factorize(data, fixed);
        inverse = {};
        levels.back().clusters.forget();
    }

    // z = M r, the V-cycle on a right side of any size, from a level on.
    void cycle(const double* r, double* z, size_t from = 0) {
        for (Level& level : levels) level.set_vectors(1);
        Level& top = levels[from];
        double norm = 0;
        for (int64_t i = 0; i < top.size(); ++i) norm = std::max(norm, std::fabs(r[i]));
        norm = top.halo->max(norm);
        if (norm == 0) {
            std::fill(z, z + top.size(), 0.0);
            return;
        }
        for_each(top.size(), [&](int64_t i) { top.c[i] = static_cast<float>(r[i] / norm); });
        descend(from);
        for_each(top.size(), [&](int64_t i) { z[i] = norm * top.x[i]; });
    }

    // The same for `count` right sides, each behind the other: several at once where all levels allow it.
    void cycles(const double* r, double* z, int64_t count, size_t from) {
        const int64_t size = levels[from].size();
        const bool serves = std::all_of(levels.begin() + from, levels.end(), [](const Level& l) { return l.serves_several(); });
        while (count > 0) {
            const int64_t done = serves ? std::min<int64_t>(count, SEVERAL) : 1;
            done > 1 ? cycle_several(r, z, static_cast<int>(done), from) : cycle(r, z, from);
            count -= done;
            r += done * size;
            z += done * size;
        }
    }

    double complexity() const {
        double all = 0;
        for (const Level& level : levels) all += static_cast<double>(level.numbers());
        const Level& finest = levels[levels.front().elements && levels.size() > 1];  // that has a matrix
        return finest.numbers() ? all / static_cast<double>(finest.numbers()) : 0.0;
    }

    int64_t bytes() const {
        int64_t all = 0;
        for (const Level& level : levels) all += level.bytes();
        for (const Transfer& transfer : transfers) all += transfer.bytes();
        return all;
    }

    std::deque<Level> levels;
    std::deque<Transfer> transfers;
    Doubles inverse;  // D^-1 of the last level, while setting up
    Settings settings;

private:
    // Does the smoothing of lines leave fields without shear in parts of this level, of a plate's nodes?
    bool shears(const Graph& g, const double* data, const Bytes& fixed, int32_t count) const {
        const Level& fine = levels.back();
        if (sets == 1 || fine.b != 3 || fine.clusters.empty()) return false;
        return least_of_lines(g, data, 3, fixed, fine.clusters, aggregates, count) < LEAST_OF_LINES;
    }

    Level& add_level() {
        levels.emplace_back();
        levels.back().thin = settings.thin > 0;
        return levels.back();
    }

    Level& add_coarse(const CoarseMatrix& matrix, const Bytes& fixed) {
        Level& coarse = add_level();
        coarse.own_indptr = matrix.indptr;
        coarse.own_indices = matrix.indices;
        const int64_t rows = static_cast<int64_t>(matrix.indptr.size()) - 1;
        inverse = coarse.set_matrix({rows, coarse.own_indptr.data(), coarse.own_indices.data()}, matrix.data.data(),
                                    fixed, MODES);
        return coarse;
    }

    void cycle_several(const double* r, double* z, int count, size_t from) {
        Level& top = levels[from];
        const int64_t size = top.size();
        for (Level& level : levels) level.set_vectors(count);
        double norms[SEVERAL] = {};
        for (int v = 0; v < SEVERAL; ++v)
            for (int64_t i = 0; v < count && i < size; ++i) norms[v] = std::max(norms[v], std::fabs(r[v * size + i]));
        for_rows(size, [&](int64_t i) KL_INLINE_LAMBDA {
            for (int v = 0; v < SEVERAL; ++v)
                top.c[i * SEVERAL + v] = norms[v] > 0 ? static_cast<float>(r[v * size + i] / norms[v]) : 0.0f;
        });
        descend(from);
        for_rows(size, [&](int64_t i) KL_INLINE_LAMBDA {
            for (int v = 0; v < count; ++v) z[v * size + i] = norms[v] * top.x[i * SEVERAL + v];
        });
    }

    void descend(size_t l) {
        Level& level = levels[l];
        if (l + 1 == levels.size()) {
            solve_coarsest(level);
            return;
        }
        Level& coarse = levels[l + 1];
        smooth(level, true);
        level.residual(level.y);
        transfers[l].restrict_to(level, coarse);
        descend(l + 1);
        transfers[l].prolong(coarse, level);
        smooth(level, false);
    }

    void smooth(Level& level, bool from_zero) const {
        const bool more = settings.thin > 1 && level.b == MODES;  // 3 times as long waves have 81 times less energy
        level.smooth(more ? 2 * settings.degree : settings.degree, more ? 40 : settings.ratio, from_zero);
    }

    void solve_coarsest(Level& level) {
        if (level.halo->solve(level.c.data(), level.x.data())) return;
        if (coarsest.at.empty()) return level.smooth(20, 400, true);  // aggregation came to a halt
        const int64_t size = level.size(), step = level.vectors > 1 ? SEVERAL : 1;
        Doubles x(size);
        for (int v = 0; v < level.vectors; ++v) {
            for (int64_t i = 0; i < size; ++i) x[i] = level.c[i * step + v];
            dispatch<double>([&](auto V) KL_INLINE_LAMBDA { substitute_rows<V>(coarsest, 0, size, x.data()); });
            for (int64_t i = 0; i < size; ++i) level.x[i * step + v] = static_cast<float>(x[i]);
        }
    }

    void factorize(const double* data, const Bytes& fixed) {
        const Level& level = levels.back();
        const int64_t N = level.size(), b = level.b;
        if (N > FULL_LIMIT) return;
        coarsest.at.assign(N + 1, 0);
        for (int64_t i = 0; i < N; ++i) coarsest.at[i + 1] = coarsest.at[i] + i;
        coarsest.rows.assign(coarsest.at[N], 0.0);
        coarsest.pivots.assign(N, 0.0);
        for (int64_t i = 0; i < level.n; ++i)
            for (int32_t k = level.graph.indptr[i]; k < level.graph.indptr[i + 1]; ++k)
                for (int64_t r = 0; r < b; ++r)
                    for (int64_t c = 0; c < b; ++c) {
                        const int64_t row = i * b + r, column = level.graph.indices[k] * b + c;
                        const double value = data[(k * b + r) * b + c];
                        if (row == column)
                            coarsest.pivots[row] = value;
                        else if (column < row && !(fixed[row] || fixed[column]))
                            coarsest.row(row)[column] = value;
                    }
        const double scale = *std::max_element(coarsest.pivots.begin(), coarsest.pivots.end());
        dispatch<double>([&](auto V) KL_INLINE_LAMBDA { factorize_rows<V>(coarsest, 0, N, 1e-13 * scale); });
    }

    // The mean coordinates of each aggregate, for each of its coarse nodes; none where those of nodes are unknown.
    static Doubles centroids(const Doubles& X, const Ints& of, int32_t count, int sets) {
        if (X.empty()) return {};
        Doubles sum(3 * static_cast<size_t>(count), 0.0), nodes(count, 0.0), repeated;
        for (size_t i = 0; i < of.size(); ++i) {
            if (of[i] < 0) continue;
            nodes[of[i]] += 1;
            for (int c = 0; c < 3; ++c) sum[3 * static_cast<size_t>(of[i]) + c] += X[3 * i + c];
        }
        for (size_t e = 0; e < sum.size(); ++e) sum[e] /= nodes[e / 3];
        for (auto at = sum.begin(); at != sum.end(); at += 3)
            for (int e = 0; e < sets; ++e) repeated.insert(repeated.end(), at, at + 3);
        return repeated;
    }

    // The first six of the columns of B.
    static Doubles first_columns(const Doubles& B, int columns) {
        Doubles out(B.size() / columns * MODES);
        for (size_t i = 0; i < out.size(); ++i) out[i] = B[i / MODES * columns + i % MODES];
        return out;
    }

    // Aggregate, smooth and multiply; returns the number of coarse nodes, or 0 if nothing is gained.
    int64_t add_transfer(const Graph& g, const double* data, const Bytes& fixed, const Ties* ties, Doubles& B,
                         Doubles& R, CoarseMatrix& next) {
        const Level& fine = levels.back();
        const int b = fine.b;
        const Bytes excluded = fine.excluded(fixed);
        Bytes strong = strong_links(g, data, b * b, settings.theta);
        Ints& of = aggregates;
        const Clusters& clusters = fine.clusters;
        if (strong.empty()) strong = clusters.near;
        for (size_t k = 0; k < clusters.near.size(); ++k) strong[k] &= clusters.near[k];
        const int32_t count = clusters.empty() ? aggregate(g, excluded, strong, of)
                                               : aggregate_clusters(b, g, data, clusters, excluded, strong, of);
        const int32_t nodes = count * sets;
        if (count == 0 || nodes * MODES > 0.9 * b * g.rows) return 0;
        if (ties) join_dependents(*ties, of);
        R = tentative_prolongator(b, of, count, B, sets);
        const Smoothing smoothing{b, g, data, fixed, of, B, sets, 4.0 / 3.0 / fine.largest};
        Prolongator P = clusters.empty() ? smoothed_prolongator(smoothing, inverse.data())
                                         : smoothed_prolongator(smoothing, clusters);
        const Transfer& t = transfers.emplace_back(std::move(P), nodes);
        if (!ties) {
            next = galerkin(b, g, data, t.P, t.columns, nodes);
            return nodes;
        }
        const Prolongator tied = with_dependents(t.P, *ties, nodes);
        next = galerkin(b, g, data, tied, Transposed(nodes, tied.indptr, tied.indices), nodes);
        return nodes;
    }

    static constexpr int64_t FULL_LIMIT = 1500;
    static constexpr double LARGEST_PLANES = 2.5, LARGEST_SETS = 1.25;  // memory of a level to that above it
    int sets = 1;          // coarse nodes of each aggregate
    bool patched = false;  // whether overlapping parts smooth
    Ints aggregates;       // of the nodes of the last level
    Skyline<double> coarsest;  // a direction without stiffness is left at zero
    Doubles X;        // nodes of the last level, where they are known
};

}  // namespace kl
