// Algebraic multigrid for matrices of 3x3 blocks, as a preconditioner and as a solver.

#include "displacement_pressure.hpp"
#include "rank_multigrid.hpp"

namespace {

using namespace kl;

// A square matrix of 3x3 blocks.
struct Matrix : Blocks<double> {
    Matrix() = default;
    Matrix(const Array<int32_t>& starts, Array<int32_t> columns, Array<double> blocks)
        : Blocks(starts, std::move(columns), std::move(blocks), starts.size() - 1, starts.size() - 1) {
        require(data.size() == 9 * indices.size(), "data must be (nnz, 3, 3)");
    }
    // Say that this is T'K T, with the rows of T of dependent components.
    void tie(std::shared_ptr<Matrix> K, Array<int32_t> dependents, Array<int32_t> indptr, Array<int32_t> independents,
             Array<double> weights) {
        require(K->rows() == rows(), "both matrices must have as many rows");
        ties = ties_of(dependents, indptr, independents, weights, rows());
        untied = std::move(K);
    }
    BlockMatrix blocks() const { return {graph(), data.data(), static_cast<uint32_t>(rows())}; }

    std::shared_ptr<Matrix> untied;
    Ties ties;
};

Doubles coordinates(Numbers points, size_t unknowns) {
    require(static_cast<size_t>(points.size()) == unknowns, "points must be (n, 3)");
    return points.copy();
}

// Tell a callback a residual; it may say stop.
bool goes_on(const Object& progress, double residual) {
    GilHeld held;
    const Object said = progress(residual);
    const int stop = PyObject_RichCompareBool(said.get(), Py_False, Py_EQ);
    if (stop < 0) throw PythonError{};
    return !stop;
}

// Modes (3n, 6) or (3n, 12) with zeros at fixed components.
Doubles free_modes(Numbers modes, const Bytes& fixed) {
    const int64_t six = MODES * static_cast<int64_t>(fixed.size());
    require(modes.size() == six || modes.size() == 2 * six, "modes must be (3n, 6) or (3n, 12)");
    Doubles B = modes.copy();
    const size_t columns = modes.size() == six ? MODES : 2 * MODES;
    for (size_t i = 0; i < B.size(); ++i)
        if (fixed[i / columns]) B[i] = 0;
    return B;
}

class Multigrid {
public:
    Multigrid(Matrix matrix, Array<uint8_t> fixed, Numbers points, Settings settings)
        : A(std::move(matrix)), fixed(fixed.copy()), hierarchy(settings) {
        require(A.rows() > 0, "there must be a node");
        require(fixed.size() == 3 * A.rows(), "fixed must have one entry for each unknown");
        Doubles X = coordinates(points, this->fixed.size());
        GilReleased release;
        hierarchy.add_nodal(A.graph(), A.data.data(), this->fixed, std::move(X));
    }

    Multigrid(std::shared_ptr<Product> product, Array<uint8_t> fixed, Numbers points, Settings settings)
        : elements(std::move(product)), fixed(fixed.copy()), hierarchy(settings) {
        require(elements->n > 0, "there must be a node");
        require(fixed.size() == 3 * elements->n, "fixed must have one entry for each unknown");
        Doubles X = coordinates(points, this->fixed.size());
        GilReleased release;
        hierarchy.add_elements(*elements, this->fixed, std::move(X));
    }

    // Smoothed aggregation below the finest level, of its matrix; where it works without one, of that given.
    void aggregate(Array<double> modes, std::optional<std::shared_ptr<Matrix>> matrix) {
        require(matrix.has_value() == (elements != nullptr), "a matrix is needed where elements take its place");
        const Matrix& finest = matrix ? **matrix : A;
        require(3 * finest.rows() == static_cast<int64_t>(fixed.size()), "the matrix must have a row for each unknown");
        Doubles B = free_modes(modes, fixed);
        coarsen([&] { coarsen_matrix(finest, fixed, std::move(B)); });
    }

    // A linear level below the finest one, and smoothed aggregation below that.
    void aggregate_linear(std::shared_ptr<Matrix> linear, Array<uint8_t> linear_fixed, Array<int32_t> indptr,
                          Array<int32_t> indices, Array<double> weights, Numbers points,
                          Array<double> modes) {
        const Matrix& finest = *linear;
        require(linear_fixed.size() == 3 * finest.rows(), "one entry for each linear unknown");
        require(3 * (indptr.size() - 1) == static_cast<int64_t>(fixed.size()), "weights must have one row for each node");
        const int of_pair = weights.size() == 9 * indices.size() && indices.size() ? 9 : 1;
        require(weights.size() == of_pair * indices.size(), "one weight, or 3 x 3, for each index is needed");
        require(are_rows(indices, finest.rows()), "indices must be nodes of the linear level");
        Bytes coarse_fixed = linear_fixed.copy();
        Doubles B = free_modes(modes, coarse_fixed), X = coordinates(points, coarse_fixed.size());
        Transfer transfer(prolongator_of(indptr, indices, weights, false), of_pair, fixed, coarse_fixed);
        coarsen([&] {
            below = std::move(linear);
            hierarchy.add_linear(finest.graph(), finest.data.data(), coarse_fixed, std::move(transfer), std::move(X));
            coarsen_matrix(finest, coarse_fixed, std::move(B));
        });
    }

    // A level of m nodes of a thin flat body below the finest one: blocks (k, 3, 6) of P, modes (6m, 12).
    void aggregate_plate(Array<int32_t> indptr, Array<int32_t> indices, Array<float> blocks, Array<double> modes) {
        require(indptr.size() == A.indptr.size(), "blocks must have one row for each node");
        require(blocks.size() == 18 * indices.size(), "blocks must be (k, 3, 6)");
        const int64_t nodes = modes.size() / (MODES * 2 * MODES);
        require(modes.size() == nodes * MODES * 2 * MODES, "modes must be (6m, 12)");
        require(are_rows(indices, nodes), "indices must be nodes of the plate");
        Prolongator P = prolongator_of(indptr, indices, blocks);
        Doubles B = modes.copy();
        coarsen([&] {
            hierarchy.coarsen_plate(A.data.data(), std::move(P), static_cast<int32_t>(nodes), std::move(B));
        });
    }

    // Of one vector r (n), or of several (k, n), of the finest level or of one below it.
    Array<double> cycle(Array<double> r, int level) {
        require(level >= 0 && level < static_cast<int>(hierarchy.levels.size()), "there is no such level");
        const int64_t size = hierarchy.levels[level].size(), count = r.ndim() == 2 ? r.shape(0) : 1;
        require(r.size() == count * size && r.shape(r.ndim() - 1) == size, "r must have one number for each unknown");
        Array<double> z = r.ndim() == 2 ? Array<double>({count, size}) : Array<double>(size);
        const double* from = r.data();
        double* to = z.mutable_data();
        GilReleased release;
        const auto turn = at_work();
        hierarchy.cycles(from, to, count, level);
        return z;
    }

    // Of A with a multiple of a matrix added to its product, if that takes the place of A.
    auto solve(Array<double> b, double tolerance, double norm, int most, const Object& progress,
               const MultipleTables& tables) {
        require(!tables || elements, "a multiple is added to products of elements alone");
        const std::optional<Multiple> added = tables ? elements->multiple(tables) : std::nullopt;
        require(b.size() == static_cast<int64_t>(fixed.size()), "b must have one number for each unknown");
        Array<double> x(b.size());
        const double* from = b.data();
        double* to = x.mutable_data();
        const bool tell = !progress.is_none();
        const auto each = [&](double residual) { return !tell || goes_on(progress, residual); };
        Outcome outcome;
        {
            GilReleased release;
            const auto turn = at_work();
            const auto times_A = [&](const double* p, double* Ap) {
                elements ? elements->multiply(p, Ap, true, added ? &*added : nullptr) : multiply(A.blocks(), p, Ap);
            };
            outcome = conjugate_gradients(times_A, fixed, hierarchy, from, to, tolerance, norm, most, each);
        }
        return std::make_tuple(x, outcome.iterations, outcome.converged);
    }

    // The number of each node's cluster; empty without clusters.
    Array<int32_t> labels() const {
        return Array<int32_t>(hierarchy.levels.front().clusters.of);
    }

    std::vector<int64_t> sizes() const {
        std::vector<int64_t> out;
        for (const Level& level : hierarchy.levels) out.push_back(level.size());
        return out;
    }

    std::vector<int64_t> clusters() const {
        std::vector<int64_t> out;
        for (const Level& level : hierarchy.levels) out.push_back(level.clusters.count());
        return out;
    }

    bool has_planes() const { return !hierarchy.levels.front().clusters.near.empty(); }
    double complexity() const { return hierarchy.complexity(); }
    auto bytes() const { return hierarchy.bytes(); }

    // The levels' vectors serve one solution at a time.
    Turns::Turn at_work() {
        Turns::Turn turn = turns.take();
        require(ready, "a multigrid must be aggregated first");
        return turn;
    }

    Matrix A;
    std::shared_ptr<Matrix> below;
    std::shared_ptr<Product> elements;  // in place of A
    Bytes fixed;
    Hierarchy hierarchy;

private:
    // Aggregate the last level, of a matrix, where it can without ties, whose rows are wide.
    void coarsen_matrix(const Matrix& finest, const Bytes& fixed, Doubles B) {
        const bool apart = finest.untied && !hierarchy.is_small() && hierarchy.levels.back().clusters.empty();
        const Matrix& K = apart ? *finest.untied : finest;
        const Ties* ties = apart ? &finest.ties : hierarchy.levels.back().elements ? &elements->ties : nullptr;
        hierarchy.coarsen(K.graph(), K.data.data(), fixed, std::move(B), ties && ties->size() ? ties : nullptr);
    }

    // Make the coarser levels, once.
    template <class F>
    void coarsen(const F& make) {
        GilReleased release;
        const auto turn = turns.take();
        require(hierarchy.levels.size() == 1 && !ready, "aggregated already");
        make();
        ready = true;
    }

    Turns turns;
    bool ready = false;
};

// Displacements by a multigrid, and pressures.
class Pressures {
public:
    Pressures(std::shared_ptr<Multigrid> multigrid, const Parts<double>& D, const Parts<float>& S, Array<double> scale,
              Array<double> bulk, Array<double> kept, Array<double> weight, double share, int most)
        : multigrid(std::move(multigrid)), M(*this->multigrid), R(block_size(D)),
          D(D, bulk.size() / R, M.A.rows()), S(S, bulk.size() / R, bulk.size() / R),
          scale(std::move(scale)), bulk(std::move(bulk)),
          kept(std::move(kept)), solver(made(weight, share, most)) {}

    auto solve(Array<double> b, double tolerance, double norm, int most, int directions, double reduced,
                    const Object& progress) {
        require(b.size() == 3 * M.A.rows(), "b must have one number for each unknown");
        Array<double> x(b.size());
        const double* from = b.data();
        double* to = x.mutable_data();
        const auto each = [&](double residual) { return goes_on(progress, residual); };
        Outcome outcome;
        {
            GilReleased release;
            const auto turn = M.at_work();
            outcome = solver.solve(from, to, tolerance, norm, {most, directions, reduced}, each);
        }
        return std::make_tuple(x, outcome.iterations, outcome.converged);
    }

private:
    static int block_size(const Parts<double>& D) {
        const auto size = std::get<2>(D).shape(1);
        require(size == 1 || size == 4, "1 or 4 pressures must share a row of blocks");
        return static_cast<int>(size);
    }

    DisplacementPressure made(const Array<double>& weight, double share, int most) {
        const int64_t pressures = bulk.size();
        require(D.data.shape(1) == R && D.data.shape(2) == 3, "blocks of D must be R x 3");
        require(S.data.shape(1) == R && S.data.shape(2) == R, "blocks of S must be R x R");
        require(pressures % R == 0 && scale.size() == pressures && kept.size() == pressures &&
                    weight.size() == 3 * M.A.rows() + pressures,
                "each pressure needs a scale, a bulk modulus, one that is kept, and a weight");
        return {M.A.blocks(), M.fixed, M.hierarchy,
                Dilatations{D.graph(), D.data.data(), R, Transposed(M.A.rows(), D.indptr.copy(), D.indices.copy())},
                PressureOperator{S.graph(), S.data.data(), scale.data(), R, share, most, {}, {}, {}, {}},
                bulk.data(), kept.data(), Doubles(weight.data(), weight.data() + weight.size())};
    }

    std::shared_ptr<Multigrid> multigrid;
    Multigrid& M;
    int R;
    Blocks<double> D;
    Blocks<float> S;
    Array<double> scale, bulk, kept;
    DisplacementPressure solver;
};

// A multigrid of a matrix or of a product.
std::shared_ptr<Multigrid> multigrid(const Object& A, Array<uint8_t> fixed, Numbers points, int degree, float ratio,
                                     double theta, int thin) {
    const Settings settings{degree, ratio, theta, thin};
    if (is_instance<Product>(A.get()))
        return std::make_shared<Multigrid>(held<Product>(A.get()), std::move(fixed), points, settings);
    if (!is_instance<Matrix>(A.get())) signature<&multigrid>.refuse("A must be a Matrix or a Product, not ", A.get());
    return std::make_shared<Multigrid>(*held<Matrix>(A.get()), std::move(fixed), points, settings);
}

}  // namespace

KL_MODULE(_multigrid, m) {
    add_class<Matrix>("kratos_lite.native.Matrix", {method<&Matrix::tie>("tie")});
    add_class<Product>("kratos_lite.native.Product",
                       {method<&Product::times>("times", nullptr, {"x", {"tied", Py_False}, {"added", Py_None}}), method<&Product::tie>("tie"),
                        method<&Product::largest_row_sum>("norm")});
    add_class<Pressures>("kratos_lite.native.Pressures", {method<&Pressures::solve>("solve")});
    add_class<Multigrid>("kratos_lite.native.Multigrid",
                         {method<&Multigrid::aggregate>("aggregate", nullptr, {"modes", {"matrix", Py_None}}),
                          method<&Multigrid::aggregate_plate>("aggregate_plate"),
                          method<&Multigrid::aggregate_linear>("aggregate_linear"),
                          method<&Multigrid::labels>("labels"),
                          method<&Multigrid::cycle>("cycle", nullptr, {"r", {"level", PyLong_FromLong(0)}}),
                          method<&Multigrid::solve>("solve", nullptr, {"b", "tolerance", "norm", "most", "progress", {"added", Py_None}}),
                          method<&Multigrid::sizes>("sizes"),
                          method<&Multigrid::clusters>("clusters"),
                          method<&Multigrid::has_planes>("has_planes"),
                          method<&Multigrid::bytes>("bytes"),
                          method<&Multigrid::complexity>("complexity")});
    add_class<RankMultigrid>("kratos_lite.native.RankMultigrid",
                             {method<&RankMultigrid::add_product>("add_product"),
                              method<&RankMultigrid::add_matrix>("add_matrix"),
                              method<&RankMultigrid::aggregates>("aggregates"),
                              method<&RankMultigrid::tentative>("tentative"),
                              method<&RankMultigrid::prolongator>("prolongator"),
                              method<&RankMultigrid::galerkin>("galerkin"), method<&RankMultigrid::finish>("finish"),
                              method<&RankMultigrid::cycle>("cycle")});
    define<&make<RankMultigrid, int, float, double, uint32_t>>(m, "RankMultigrid", "a multigrid over ranks",
                                                               {"degree", "ratio", "theta", "rank"});
    define<&make<Matrix, Array<int32_t>, Array<int32_t>, Array<double>>>(m, "Matrix", "a matrix of 3x3 blocks",
                                                                         {"indptr", "indices", "data"});
    define<&make<Product, Array<double>, std::vector<ElementTables>>>(
        m, "Product", "products of the stiffness of elements, without a matrix", {"points", "groups"});
    define<&multigrid>(m, "Multigrid", "a multigrid of a Matrix or a Product",
                       {"A", "fixed", "points", "degree", "ratio", "theta", {"thin", PyLong_FromLong(0)}});
    define<&make<Pressures, std::shared_ptr<Multigrid>, Parts<double>, Parts<float>, Array<double>, Array<double>,
                 Array<double>, Array<double>, double, int>>(
        m, "Pressures", "displacements by a multigrid, and pressures",
        {"multigrid", "D", "S", "scale", "bulk", "kept", "weight", "share", "most"});
}
