// A multigrid over ranks, each of which has the rows of its own nodes, 0 … n - 1; copies of those of others
// stand behind them.

#pragma once
#include "hierarchy.hpp"
#include "product.hpp"

namespace kl {

// Arrays (indptr, indices, data) of a sparse matrix.
template <class T>
using Parts = std::tuple<Array<int32_t>, Array<int32_t>, Array<T>>;

// A sparse matrix of blocks, whose arrays were checked, and are kept.
template <class T>
struct Blocks {
    Array<int32_t> indptr, indices;
    Array<T> data;

    Blocks() = default;
    Blocks(const Parts<T>& parts, int64_t rows, int64_t width)
        : Blocks(std::get<0>(parts), std::get<1>(parts), std::get<2>(parts), rows, width) {}
    Blocks(Array<int32_t> starts, Array<int32_t> columns, Array<T> blocks, int64_t rows, int64_t width)
        : indptr(std::move(starts)), indices(std::move(columns)), data(std::move(blocks)) {
        require(data.ndim() == 3 && data.shape(0) == indices.size(), "data must be (nnz, R, C)");
        require(indptr.size() == rows + 1, "the matrix must have a row for each row of blocks");
        check_rows(indptr, indices.size());
        require(are_rows(indices, width), "indices must be columns of the matrix");
    }
    int64_t rows() const { return indptr.size() - 1; }
    Graph graph() const { return {rows(), indptr.data(), indices.data()}; }
};

template <class T>
Prolongator prolongator_of(Indices indptr, Indices indices, const Array<T>& data, bool ascending = true) {
    check_rows(indptr, indices.size());
    const int32_t *start = indptr.data(), *column = indices.data();
    for (int64_t i = 0; ascending && i + 1 < indptr.size(); ++i)  // as Galerkin's product goes through them
        for (int32_t k = start[i] + 1; k < start[i + 1]; ++k)
            require(column[k - 1] < column[k], "the columns of each row of P must rise");
    Prolongator P{indptr.copy(), indices.copy(), {data.data(), data.data() + data.size()}};
    P.data.resize(P.data.size() + 8);
    return P;
}

// What an object of Python does between ranks, with methods of these names that take memory of float32.
class RankHalo : public Halo {
public:
    RankHalo(Object python, int64_t numbers) : python(std::move(python)), bytes(4 * numbers) {}

    void update(float* v) const override { call("update", v); }
    void add(float* v) const override { call("add", v); }
    double sum(double x) const override { return reduced("sum", x); }
    double max(double x) const override { return reduced("max", x); }
    bool solve(float* c, float* x) const override { return call("solve", c, x); }

private:
    template <class... V>
    bool call(const char* name, V... vectors) const {
        GilHeld held;
        const Object method = python.attribute(name);
        const auto memory = [&](float* v) {
            return Object::of(PyMemoryView_FromMemory(reinterpret_cast<char*>(v), bytes, PyBUF_WRITE));
        };
        return Given<bool>::of(
            Object::of(PyObject_CallFunctionObjArgs(method.get(), memory(vectors).get()..., nullptr)).get());
    }

    double reduced(const char* name, double x) const {
        GilHeld held;
        return Given<double>::of(python.attribute(name)(x).get());
    }

    Object python;
    Py_ssize_t bytes;
};

class RankMultigrid {
public:
    RankMultigrid(int degree, float ratio, double theta, uint32_t rank) : hierarchy({degree, ratio, theta}), rank(rank) {}

    // The finest level, of elements; the first `own` of its nodes are own ones.
    void add_product(std::shared_ptr<Product> product, int64_t own, Array<uint8_t> fixed_components, Object halo) {
        require(fixed_components.size() == 3 * product->n && own >= 0 && own <= product->n, "fixed must be that of all nodes");
        elements = std::move(product);
        fixed = fixed_components.copy();
        add(halo, [&](Level& level) { return level.set_elements(*elements, fixed, own); });
    }

    // A level of blocks (nnz, b, b) with columns among all nodes; and the way to it from that above, blocks (nnz, b, 6)
    // or one weight for each pair of nodes.
    void add_matrix(const Parts<double>& A, Array<uint8_t> fixed_components, Object halo,
                    const std::optional<Parts<float>>& P) {
        const int b = static_cast<int>(std::get<2>(A).shape(1));
        const int64_t all = fixed_components.size() / b;
        require(b == 3 || b == MODES, "blocks must be 3x3 or 6x6");
        const Blocks<double> matrix(A, std::get<0>(A).size() - 1, all);
        require(matrix.data.shape(2) == b && matrix.rows() <= all, "blocks must be square, and fixed that of all nodes");
        require(P.has_value() != hierarchy.levels.empty(), "a way leads to each level but the first");
        Bytes held = fixed_components.copy();
        if (P) hierarchy.transfers.push_back(transfer(*P, held));
        fixed = std::move(held);
        patterns.push_back(blocks = matrix);
        patterns.back().data = {};
        add(halo, [&](Level& level) { return level.set_matrix(blocks.graph(), blocks.data.data(), fixed, b); });
    }

    // The aggregate of each own node, -1 for fixed ones, and how many there are; links to copies do not join.
    auto aggregates() const {
        Ints of;
        const int32_t count = without_gil([&] {
            const Level& last = with_matrix();
            const Bytes strong = strong_links(last.graph, blocks.data.data(), last.b * last.b, hierarchy.settings.theta);
            return aggregate(last.graph, last.excluded(fixed), strong, of);
        });
        return std::make_tuple(Array<int32_t>(of), count);
    }

    // The modes (n, b, 6) made orthonormal over each aggregate, and those of the coarse nodes (count, 6, 6).
    auto tentative(Indices of, int count, Numbers modes) const {
        const Level& last = with_matrix();
        require(of.size() == last.n && modes.size() == MODES * last.size(), "modes must be (n, b, 6)");
        const Ints group = of.copy();
        for (int32_t each : group) require(each < count, "there is no such aggregate");
        Doubles T = modes.copy();
        const Doubles R = without_gil([&] { return tentative_prolongator(last.b, group, count, T, 1); });
        return std::make_tuple(Array<double>(T), Array<double>(R));
    }

    // Own rows of the smoothed prolongator: `of` and T (all nodes, b, 6) say which coarse node each node belongs to,
    // and how.
    auto prolongator(Indices of, Numbers T) const {
        const Level& last = with_matrix();
        require(of.size() * last.b == all() && T.size() == MODES * all(), "T must be (all, b, 6)");
        const Ints group = of.copy();
        const Doubles modes = T.copy();
        const Smoothing smoothing{last.b, last.graph, blocks.data.data(), fixed, group, modes, 1, 4.0 / 3.0 / last.largest};
        Prolongator P = without_gil([&] { return smoothed_prolongator(smoothing, hierarchy.inverse.data()); });
        P.data.resize(P.indices.size() * last.b * MODES);
        return std::make_tuple(Array<int32_t>(P.indptr), Array<int32_t>(P.indices), Array<float>(P.data));
    }

    // What own rows give to P^T A P, with rows of P for all nodes, and coarse nodes among `count`.
    auto galerkin(Indices indptr, Indices indices, const Array<float>& values, int count) const {
        const Level& last = with_matrix();
        require((indptr.size() - 1) * last.b == all() && values.size() == MODES * last.b * indices.size() &&
                    are_rows(indices, count),
                "P must have rows of blocks for all nodes");
        const Prolongator P = prolongator_of(indptr, indices, values);
        const CoarseMatrix C = without_gil([&] {
            const Ints starts(P.indptr.begin(), P.indptr.begin() + last.n + 1);
            const Transposed columns(count, starts, {P.indices.begin(), P.indices.begin() + starts.back()});
            return galerkin_sum(last.b, last.graph, blocks.data.data(), P, columns, count);
        });
        return std::make_tuple(Array<int32_t>(C.indptr), Array<int32_t>(C.indices), Array<double>(C.data));
    }

    // Let go of what only further levels are made of.
    void finish() {
        hierarchy.inverse = {};
        blocks = {};
    }

    // One V-cycle on the residual of own nodes; all ranks call it.
    Array<double> cycle(Array<double> r) {
        require(!hierarchy.levels.empty() && r.size() == hierarchy.levels.front().size(), "r must have one number for each unknown");
        Array<double> z(r.size());
        double* to = z.mutable_data();
        GilReleased release;
        const auto turn = turns.take();
        hierarchy.cycle(r.data(), to);
        return z;
    }

private:
    template <class F>
    void add(const Object& halo, const F& set) {
        auto shared = std::make_shared<RankHalo>(halo, static_cast<int64_t>(fixed.size()));
        GilReleased release;
        hierarchy.add_shared(std::move(shared), set, rank);
    }

    Transfer transfer(const Parts<float>& P, const Bytes& coarse_fixed) const {
        const auto& [indptr, indices, data] = P;
        const Level& fine = hierarchy.levels.back();
        const bool weights = data.ndim() == 1;
        const int64_t coarse = static_cast<int64_t>(coarse_fixed.size()) / (weights ? 3 : MODES);
        require(indptr.size() == fine.n + 1 && are_rows(indices, coarse), "P must lead from own nodes to coarse ones");
        require(data.size() == (weights ? 1 : fine.b * MODES) * indices.size(), "P must be weights (nnz) or blocks (nnz, b, 6)");
        Prolongator blocks = prolongator_of(indptr, indices, data, !weights);
        return weights ? Transfer(std::move(blocks), 1, fixed, coarse_fixed) : Transfer(std::move(blocks), coarse);
    }

    const Level& with_matrix() const {
        require(blocks.data.size() > 0 || blocks.indptr.size() > 0, "there is no matrix, or it is forgotten");
        return hierarchy.levels.back();
    }
    int64_t all() const { return static_cast<int64_t>(fixed.size()); }

    Hierarchy hierarchy;
    uint32_t rank;
    std::shared_ptr<Product> elements;
    Bytes fixed;             // components of all nodes of the last level
    Blocks<double> blocks;   // of the last level, while setting up
    std::vector<Blocks<double>> patterns;
    Turns turns;
};

}  // namespace kl
