// Algebraic multigrid for matrices of 3x3 blocks, as a preconditioner and as a solver.

#include "displacement_pressure.hpp"
#include "elements.hpp"
#include "rank_multigrid.hpp"

namespace {

using namespace kl;

// A sparse matrix of blocks, whose arrays were checked, and are kept.
template <class T>
struct Blocks {
    Array<int32_t> indptr, indices;
    Array<T> data;

    Blocks() = default;
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

// A square matrix of 3x3 blocks.
struct Matrix : Blocks<double> {
    Matrix() = default;
    Matrix(const Array<int32_t>& starts, Array<int32_t> columns, Array<double> blocks)
        : Blocks(starts, std::move(columns), std::move(blocks), starts.size() - 1, starts.size() - 1) {
        require(data.size() == 9 * indices.size(), "data must be (nnz, 3, 3)");
    }
    BlockMatrix blocks() const { return {graph(), data.data(), static_cast<uint32_t>(rows())}; }
};

// From places to points and to slopes (n, n), and from nodes to places (n^3, k), of a tensor product rule whose
// points come in the order of the places.
using Factors = std::optional<std::tuple<Array<double>, Array<double>, Array<double>>>;

TensorTables<double> tensor_tables(const Factors& factors, const Elements& w) {
    TensorTables<double> t;
    if (!factors) return t;
    const auto& [values, slopes, places] = *factors;
    t.n = static_cast<int>(values.shape(0));
    require((t.n == 2 || t.n == 3) && has_shape(values, t.n, t.n) && has_shape(slopes, t.n, t.n) &&
                w.g == t.n * t.n * t.n && has_shape(places, w.g, w.k),
            "factors must be two (n, n) with n = 2 or 3, and (n^3, k)");
    std::copy(values.data(), values.data() + values.size(), t.values);
    std::copy(slopes.data(), slopes.data() + slopes.size(), t.slopes);
    t.place.assign(w.k, -1);
    for (int p = 0; p < w.g; ++p) {
        const double* row = places.data() + static_cast<int64_t>(p) * w.k;
        const auto is_one = [](double weight) { return weight == 1; };
        const bool single = std::count(row, row + w.k, 0.0) == w.k - 1 && std::count_if(row, row + w.k, is_one);
        if (single)
            t.place[std::find_if(row, row + w.k, is_one) - row] = p;
        else {
            t.extra.push_back(p);
            t.weights.insert(t.weights.end(), row, row + w.k);
        }
    }
    for (int p : t.place) require(p >= 0, "each node must have a place");
    return t;
}

// Elements of a kind (nodes, dN, weights, C, factors), whose arrays are kept.
using ElementTables = std::tuple<Array<int32_t>, Array<double>, Array<double>, Array<double>, Factors>;

class Product : public MatrixFree {
public:
    Product(Numbers points, std::vector<ElementTables> groups)
        : MatrixFree(points.size() / 3, points.data()), groups(std::move(groups)) {
        for (const auto& [nodes, dN, weights, C, factors] : this->groups) {
            Elements w = elements(points, nodes, dN, weights);
            set_law(w, C, {});
            add(w, tensor_tables(factors, w));
        }
        GilReleased release;
        prepare();
    }

    // Components that depend on others from now on, with their weights.
    void tie(Array<int32_t> dependents, Array<int32_t> indptr, Array<int32_t> independents, Array<double> weights) {
        require(indptr.size() == dependents.size() + 1, "indptr must have a row for each dependent component");
        require(weights.size() == independents.size(), "one weight for each index is needed");
        check_rows(indptr, independents.size());
        require(are_rows(dependents, 3 * n) && are_rows(independents, 3 * n), "indices must be components of nodes");
        const auto copied = [](const auto& array) { return std::vector(array.data(), array.data() + array.size()); };
        ties = Ties(copied(dependents), copied(indptr), copied(independents), copied(weights), n);
    }

    Array<double> times(Array<double> x, bool tied) const {
        require(x.size() == 3 * n, "x must have three numbers for each point");
        Array<double> y(3 * n);
        Doubles from(x.data(), x.data() + 3 * n);
        from.push_back(0);
        double* to = y.mutable_data();
        GilReleased release;
        multiply(from.data(), to, tied);
        return y;
    }

    double largest_row_sum() const {
        GilReleased release;
        return norm();
    }

private:
    std::vector<ElementTables> groups;
};

Doubles coordinates(Numbers points, size_t unknowns) {
    require(static_cast<size_t>(points.size()) == unknowns, "points must be (n, 3)");
    return {points.data(), points.data() + points.size()};
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
    Doubles B(modes.data(), modes.data() + modes.size());
    const size_t columns = modes.size() == six ? MODES : 2 * MODES;
    for (size_t i = 0; i < B.size(); ++i)
        if (fixed[i / columns]) B[i] = 0;
    return B;
}

class Multigrid {
public:
    Multigrid(Matrix matrix, Array<uint8_t> fixed, Numbers points, Settings settings)
        : A(std::move(matrix)), fixed(bytes_in(fixed)), hierarchy(settings) {
        require(A.rows() > 0, "there must be a node");
        require(fixed.size() == 3 * A.rows(), "fixed must have one entry for each unknown");
        Doubles X = coordinates(points, this->fixed.size());
        GilReleased release;
        hierarchy.add_nodal(A.graph(), A.data.data(), this->fixed, std::move(X));
    }

    Multigrid(std::shared_ptr<Product> product, Array<uint8_t> fixed, Numbers points, Settings settings)
        : elements(std::move(product)), fixed(bytes_in(fixed)), hierarchy(settings) {
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
        coarsen([&] { hierarchy.coarsen(finest.graph(), finest.data.data(), fixed, std::move(B)); });
    }

    // A linear level below the finest one, and smoothed aggregation below that.
    void aggregate_linear(std::shared_ptr<Matrix> linear, Array<uint8_t> linear_fixed, Array<int32_t> indptr,
                          Array<int32_t> indices, Array<double> weights, Numbers points,
                          Array<double> modes) {
        const Matrix& finest = *linear;
        require(linear_fixed.size() == 3 * finest.rows(), "one entry for each linear unknown");
        require(3 * (indptr.size() - 1) == static_cast<int64_t>(fixed.size()), "weights must have one row for each node");
        require(weights.size() == indices.size(), "one weight for each index is needed");
        require(are_rows(indices, finest.rows()), "indices must be nodes of the linear level");
        Bytes coarse_fixed = bytes_in(linear_fixed);
        Doubles B = free_modes(modes, coarse_fixed), X = coordinates(points, coarse_fixed.size());
        Transfer transfer;
        transfer.P = prolongator_of(indptr, indices, weights, false);
        coarsen([&] {
            below = std::move(linear);
            hierarchy.add_linear(finest.graph(), finest.data.data(), coarse_fixed, std::move(transfer), fixed,
                                 std::move(X));
            hierarchy.coarsen(finest.graph(), finest.data.data(), coarse_fixed, std::move(B));
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
        Doubles B(modes.data(), modes.data() + modes.size());
        coarsen([&] {
            hierarchy.coarsen_plate(A.data.data(), std::move(P), static_cast<int32_t>(nodes), std::move(B));
        });
    }

    Array<double> cycle(Array<double> r) {
        require(r.size() == static_cast<int64_t>(fixed.size()), "r must have one number for each unknown");
        Array<double> z(r.size());
        const double* from = r.data();
        double* to = z.mutable_data();
        GilReleased release;
        const auto turn = at_work();
        hierarchy.cycle(from, to);
        return z;
    }

    auto solve(Array<double> b, double tolerance, double norm, int most, const Object& progress) {
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
                elements ? elements->multiply(p, Ap) : multiply(A.blocks(), p, Ap);
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
    // Arrays (indptr, indices, data) of a sparse matrix.
    template <class T>
    using Parts = std::tuple<Array<int32_t>, Array<int32_t>, Array<T>>;

    Pressures(std::shared_ptr<Multigrid> multigrid, const Parts<double>& D, const Parts<float>& S, Array<double> scale,
              Array<double> bulk, Array<double> kept, Array<double> weight, double share, int most)
        : multigrid(std::move(multigrid)), M(*this->multigrid), R(block_size(D)),
          D(blocks(D, bulk.size() / R, M.A.rows())), S(blocks(S, bulk.size() / R, bulk.size() / R)),
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

    template <class T>
    static Blocks<T> blocks(const Parts<T>& parts, int64_t rows, int64_t columns) {
        return {std::get<0>(parts), std::get<1>(parts), std::get<2>(parts), rows, columns};
    }

    DisplacementPressure made(const Array<double>& weight, double share, int most) {
        const int64_t pressures = bulk.size();
        require(D.data.shape(1) == R && D.data.shape(2) == 3, "blocks of D must be R x 3");
        require(S.data.shape(1) == R && S.data.shape(2) == R, "blocks of S must be R x R");
        require(pressures % R == 0 && scale.size() == pressures && kept.size() == pressures &&
                    weight.size() == 3 * M.A.rows() + pressures,
                "each pressure needs a scale, a bulk modulus, one that is kept, and a weight");
        const Ints starts(D.indptr.data(), D.indptr.data() + D.indptr.size());
        const Ints columns(D.indices.data(), D.indices.data() + D.indices.size());
        return {M.A.blocks(), M.fixed, M.hierarchy,
                Dilatations{D.graph(), D.data.data(), R, Transposed(M.A.rows(), starts, columns)},
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

auto matrix(Array<int32_t> indptr, Array<int32_t> indices, Array<double> data) {
    return std::make_shared<Matrix>(std::move(indptr), std::move(indices), std::move(data));
}

auto product(Numbers points, std::vector<ElementTables> groups) {
    return std::make_shared<Product>(points, std::move(groups));
}

// A multigrid of a matrix or of a product.
std::shared_ptr<Multigrid> multigrid(const Object& A, Array<uint8_t> fixed, Numbers points, int degree, float ratio,
                                     double theta, int thin) {
    const Settings settings{degree, ratio, theta, thin};
    if (is_instance<Product>(A.get()))
        return std::make_shared<Multigrid>(held<Product>(A.get()), std::move(fixed), points, settings);
    if (!is_instance<Matrix>(A.get())) signature<&multigrid>.refuse("A must be a Matrix or a Product, not ", A.get());
    return std::make_shared<Multigrid>(*held<Matrix>(A.get()), std::move(fixed), points, settings);
}

auto pressures(std::shared_ptr<Multigrid> multigrid, const Pressures::Parts<double>& D, const Pressures::Parts<float>& S,
               Array<double> scale, Array<double> bulk, Array<double> kept, Array<double> weight, double share,
               int most) {
    return std::make_shared<Pressures>(std::move(multigrid), D, S, std::move(scale), std::move(bulk), std::move(kept),
                                       std::move(weight), share, most);
}

auto shared_level(Array<int32_t> indptr, Array<int32_t> indices, Array<double> data, Array<uint8_t> fixed, int b) {
    return std::make_shared<SharedLevel>(std::move(indptr), std::move(indices), std::move(data), std::move(fixed), b);
}

auto shared_product(std::shared_ptr<Product> product, Array<uint8_t> fixed, int64_t own) {
    return std::make_shared<SharedLevel>(*product, product, std::move(fixed), own);
}

auto shared_transfer(Array<int32_t> indptr, Array<int32_t> indices, Array<float> data, int b, int64_t fine,
                     int64_t coarse, Array<uint8_t> fine_fixed, Array<uint8_t> coarse_fixed) {
    return std::make_shared<SharedTransfer>(indptr, indices, data, b, fine, coarse, fine_fixed, coarse_fixed);
}

}  // namespace

KL_MODULE(_multigrid, m) {
    add_class<Matrix>("kratos_lite.native.Matrix", {});
    add_class<Product>("kratos_lite.native.Product",
                       {method<&Product::times>("times", nullptr, {"x", {"tied", Py_False}}), method<&Product::tie>("tie"),
                        method<&Product::largest_row_sum>("norm")});
    add_class<Pressures>("kratos_lite.native.Pressures", {method<&Pressures::solve>("solve")});
    add_class<Multigrid>("kratos_lite.native.Multigrid",
                         {method<&Multigrid::aggregate>("aggregate", nullptr, {"modes", {"matrix", Py_None}}),
                          method<&Multigrid::aggregate_plate>("aggregate_plate"),
                          method<&Multigrid::aggregate_linear>("aggregate_linear"),
                          method<&Multigrid::labels>("labels"),
                          method<&Multigrid::cycle>("cycle"),
                          method<&Multigrid::solve>("solve"),
                          method<&Multigrid::sizes>("sizes"),
                          method<&Multigrid::clusters>("clusters"),
                          method<&Multigrid::has_planes>("has_planes"),
                          method<&Multigrid::bytes>("bytes"),
                          method<&Multigrid::complexity>("complexity")});
    add_class<SharedLevel>("kratos_lite.native.SharedLevel",
                           {method<&SharedLevel::step>("step"), method<&SharedLevel::first_step>("first_step"),
                            method<&SharedLevel::aggregates>("aggregates"), method<&SharedLevel::tentative>("tentative"),
                            method<&SharedLevel::prolongator>("prolongator"),
                            method<&SharedLevel::galerkin>("galerkin"), method<&SharedLevel::forget>("forget"),
                            method<&SharedLevel::bytes>("bytes")});
    add_class<SharedTransfer>("kratos_lite.native.SharedTransfer",
                              {method<&SharedTransfer::restrict_to>("restrict_to"),
                               method<&SharedTransfer::prolong>("prolong"), method<&SharedTransfer::bytes>("bytes")});
    define<&shared_level>(m, "SharedLevel", "a level of a multigrid over ranks, of a matrix",
                          {"indptr", "indices", "data", "fixed", "b"});
    define<&shared_product>(m, "SharedProduct", "a level of a multigrid over ranks, of a Product",
                            {"product", "fixed", "own"});
    define<&shared_transfer>(m, "SharedTransfer", "a transfer between levels of a multigrid over ranks",
                             {"indptr", "indices", "data", "b", "fine", "coarse", "fine_fixed", "coarse_fixed"});
    define<&matrix>(m, "Matrix", "a matrix of 3x3 blocks", {"indptr", "indices", "data"});
    define<&product>(m, "Product", "products of the stiffness of elements, without a matrix", {"points", "groups"});
    define<&multigrid>(m, "Multigrid", "a multigrid of a Matrix or a Product",
                       {"A", "fixed", "points", "degree", "ratio", "theta", {"thin", PyLong_FromLong(0)}});
    define<&pressures>(m, "Pressures", "displacements by a multigrid, and pressures",
                       {"multigrid", "D", "S", "scale", "bulk", "kept", "weight", "share", "most"});
}
