// Algebraic multigrid for matrices of 3x3 blocks, as a preconditioner and as a solver.

#include "arrays.hpp"
#include "conjugate_gradients.hpp"

namespace {

using kl::Array;
namespace py = pybind11;

struct Matrix {
    Array<int32_t> indptr, indices;
    Array<double> data;
    kl::Graph graph() const { return {indptr.size() - 1, indptr.data(), indices.data()}; }
    kl::BlockMatrix blocks() const { return {graph(), data.data(), static_cast<uint32_t>(indptr.size() - 1)}; }
};

std::vector<uint8_t> bytes_of(const Array<uint8_t>& a) { return {a.data(), a.data() + a.size()}; }

std::vector<double> coordinates(const Array<double>& points, size_t unknowns) {
    kl::require(static_cast<size_t>(points.size()) == unknowns, "points must be (n, 3)");
    return {points.data(), points.data() + points.size()};
}

// Modes (3n, 6) with zeros at fixed components.
std::vector<double> free_modes(const Array<double>& modes, const std::vector<uint8_t>& fixed) {
    kl::require(modes.size() == 6 * static_cast<int64_t>(fixed.size()), "modes must be (3n, 6)");
    std::vector<double> B(modes.data(), modes.data() + modes.size());
    for (size_t i = 0; i < B.size(); ++i)
        if (fixed[i / 6]) B[i] = 0;
    return B;
}

class Multigrid {
public:
    Multigrid(Matrix matrix, Array<uint8_t> fixed, Array<double> points, kl::Settings settings)
        : A(std::move(matrix)), fixed(bytes_of(fixed)), hierarchy(settings) {
        kl::require(fixed.size() == 3 * (A.indptr.size() - 1), "fixed must have one entry for each unknown");
        std::vector<double> X = coordinates(points, this->fixed.size());
        py::gil_scoped_release release;
        hierarchy.add_nodal(A.graph(), A.data.data(), this->fixed, std::move(X));
    }

    // Smoothed aggregation below the finest level.
    void aggregate(Array<double> modes) {
        kl::require(hierarchy.levels.size() == 1, "aggregated already");
        std::vector<double> B = free_modes(modes, fixed);
        py::gil_scoped_release release;
        hierarchy.coarsen(A.data.data(), fixed, std::move(B));
    }

    // A linear level below the finest one, and smoothed aggregation below that.
    void aggregate_linear(Matrix linear, Array<uint8_t> linear_fixed, Array<int32_t> indptr,
                          Array<int32_t> indices, Array<double> weights, Array<double> points,
                          Array<double> modes) {
        kl::require(hierarchy.levels.size() == 1, "aggregated already");
        below = std::move(linear);
        kl::require(linear_fixed.size() == 3 * (below.indptr.size() - 1), "one entry for each linear unknown");
        kl::require(indptr.size() == A.indptr.size(), "weights must have one row for each node");
        kl::require(indices.size() == indptr.data()[indptr.size() - 1] && weights.size() == indices.size(),
                    "one weight for each index is needed");
        std::vector<uint8_t> apart = bytes_of(linear_fixed);
        std::vector<double> B = free_modes(modes, apart), X = coordinates(points, apart.size());
        kl::Transfer transfer;
        transfer.P.indptr.assign(indptr.data(), indptr.data() + indptr.size());
        transfer.P.indices.assign(indices.data(), indices.data() + indices.size());
        transfer.P.data.assign(weights.data(), weights.data() + weights.size());
        py::gil_scoped_release release;
        hierarchy.add_linear(below.graph(), below.data.data(), apart, std::move(transfer), fixed,
                             std::move(X));
        hierarchy.coarsen(below.data.data(), apart, std::move(B));
    }

    Array<double> cycle(Array<double> r) {
        kl::require(r.size() == static_cast<int64_t>(fixed.size()), "r must have one number for each unknown");
        Array<double> z(r.size());
        const double* from = r.data();
        double* to = z.mutable_data();
        py::gil_scoped_release release;
        std::lock_guard<std::mutex> lock(busy);
        hierarchy.cycle(from, to);
        return z;
    }

    py::tuple solve(Array<double> b, double tolerance, double norm, int most, py::object progress) {
        kl::require(b.size() == static_cast<int64_t>(fixed.size()), "b must have one number for each unknown");
        Array<double> x(b.size());
        const double* from = b.data();
        double* to = x.mutable_data();
        const bool tell = !progress.is_none();
        const auto each = [&](double residual) {
            if (!tell) return true;
            py::gil_scoped_acquire acquire;
            return !progress(residual).is(py::bool_(false));  // it may say stop
        };
        kl::Outcome outcome;
        {
            py::gil_scoped_release release;
            std::lock_guard<std::mutex> lock(busy);
            outcome = kl::conjugate_gradients(A.blocks(), fixed, hierarchy, from, to, tolerance, norm, most, each);
        }
        return py::make_tuple(x, outcome.iterations, outcome.converged);
    }

    py::list sizes() const {
        py::list out;
        for (const kl::Level& level : hierarchy.levels) out.append(level.size());
        return out;
    }

    py::list clusters() const {
        py::list out;
        for (const kl::Level& level : hierarchy.levels) out.append(level.clusters.count());
        return out;
    }

    Matrix A, below;
    std::vector<uint8_t> fixed;
    kl::Hierarchy hierarchy;

private:
    std::mutex busy;  // the levels' vectors serve one solution at a time
};

}  // namespace

PYBIND11_MODULE(_multigrid, m) {
    kl::common(m);
    py::class_<Matrix>(m, "Matrix")
        .def(py::init([](Array<int32_t> indptr, Array<int32_t> indices, Array<double> data) {
                 kl::require(data.size() == 9 * indices.size(), "data must be (nnz, 3, 3)");
                 kl::require(indptr.size() > 0 && indptr.data()[indptr.size() - 1] == indices.size(),
                             "indptr must end with the number of blocks");
                 return Matrix{indptr, indices, data};
             }),
             py::arg("indptr").noconvert(), py::arg("indices").noconvert(), py::arg("data").noconvert());
    py::class_<Multigrid>(m, "Multigrid")
        .def(py::init([](Matrix A, Array<uint8_t> fixed, Array<double> points, int degree, float ratio,
                         double theta) {
            kl::Settings settings;
            settings.degree = degree;
            settings.ratio = ratio;
            settings.theta = theta;
            return std::make_unique<Multigrid>(std::move(A), fixed, points, settings);
        }))
        .def("aggregate", &Multigrid::aggregate)
        .def("aggregate_linear", &Multigrid::aggregate_linear)
        .def("cycle", &Multigrid::cycle)
        .def("solve", &Multigrid::solve)
        .def("sizes", &Multigrid::sizes)
        .def("clusters", &Multigrid::clusters)
        .def("bytes", [](const Multigrid& m) { return m.hierarchy.bytes(); })
        .def("complexity", [](const Multigrid& m) { return m.hierarchy.complexity(); });
}
