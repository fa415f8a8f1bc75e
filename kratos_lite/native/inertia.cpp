// Matrices of mass at rest or in flow, M, G and H, for elements of any shape.
//
// Arguments: points (n, 3) of the nodes, nodes (m, k) of the elements, N (g, k), dN (g, k, 3) and weights (g)
// times ρ of a rule, the velocity c = A X + b as (3, 4), the pattern, and data (nnz,) of each matrix or None.
// Sums run over the elements in their order, whatever the number of threads.

#include "inertia.hpp"

#include "arrays.hpp"
#include "stiffness.hpp"

namespace {

using kl::Array;
using kl::Inertia;
using kl::require;
namespace py = pybind11;

using Floats = const Array<double>&;
using Rows = const Array<int32_t>&;

// Data of an array (nnz,) to be added to, or null of None.
double* optional(const py::object& array, int64_t size) {
    if (array.is_none()) return nullptr;
    require(Array<double>::check_(array), "data must be float (nnz,)");
    auto given = py::reinterpret_borrow<Array<double>>(array);
    require(given.size() == size, "data must be float (nnz,)");
    return given.mutable_data();
}

Inertia inertia(Floats points, Rows nodes, Floats N, Floats dN, Floats weights, Floats velocity) {
    require(points.ndim() == 2 && points.shape(1) == 3, "points must be (n, 3)");
    require(nodes.ndim() == 2, "nodes must be (m, k)");
    require(dN.ndim() == 3 && dN.shape(1) == nodes.shape(1) && dN.shape(2) == 3, "dN must be (g, k, 3)");
    require(N.ndim() == 2 && N.shape(0) == dN.shape(0) && N.shape(1) == dN.shape(1), "N must be (g, k)");
    require(weights.size() == dN.shape(0), "weights must be (g)");
    require(velocity.ndim() == 2 && velocity.shape(0) == 3 && velocity.shape(1) == 4, "velocity must be (3, 4)");
    for (int64_t i = 0; i < nodes.size(); ++i)
        require(static_cast<uint32_t>(nodes.data()[i]) < points.shape(0), "nodes must be rows of points");
    Inertia w{};
    w.points = points.data();
    w.nodes = nodes.data();
    w.k = static_cast<int>(nodes.shape(1));
    w.g = static_cast<int>(dN.shape(0));
    w.N = N.data();
    w.dN = dN.data();
    w.weights = weights.data();
    w.velocity = velocity.data();
    w.last = nodes.shape(0);
    w.wide.assign(static_cast<int64_t>(w.g) * w.wide_k(), 0.0);
    for (int q = 0; q < w.g; ++q) std::copy_n(w.N + q * w.k, w.k, w.wide.data() + q * w.wide_k());
    return w;
}

void add_groups(const Inertia& w, const kl::Connectivity& mesh, const kl::Graph& graph, const kl::Shares& shares,
                int64_t share) {
    const int V = kl::lanes();
    const int64_t pairs = static_cast<int64_t>(V) * w.k * w.k;  // of a group
    const int64_t block = std::max<int64_t>(8, kl::BLOCK_PAIRS / pairs);
    kl::Places places(graph, mesh, shares, share, block * V);
    std::vector<double> work(kl::inertia_size(w, V) + 8);
    auto* aligned = reinterpret_cast<double*>((reinterpret_cast<uintptr_t>(work.data()) + 63) / 64 * 64);
    std::vector<int64_t> elements(block * V);
    const auto& groups = shares.groups(share);
    const int64_t total = static_cast<int64_t>(groups.size());
    for (int64_t from = 0; from < total; from += block) {
        const int64_t count = std::min(block, total - from);
        for (int64_t i = 0; i < count * V; ++i)
            elements[i] = static_cast<int64_t>(groups[from + i / V]) * V + i % V;
        const int32_t* place = places.find(elements.data(), count * V);
        for (int64_t i = 0; i < count; ++i)
            kl::add_inertia_group({w, elements[i * V], aligned, place + i * pairs});
    }
}

void add(Floats points, Rows nodes, Floats N, Floats dN, Floats weights, Floats velocity, Rows indptr,
         Rows indices, py::object M, py::object G, py::object H) {
    Inertia w = inertia(points, nodes, N, dN, weights, velocity);
    require(indptr.size() == points.shape(0) + 1, "the pattern must have a row for each point");
    w.M = optional(M, indices.size());
    w.G = optional(G, indices.size());
    w.H = optional(H, indices.size());
    const kl::Connectivity mesh{w.nodes, w.last, w.k};
    const kl::Graph graph{points.shape(0), indptr.data(), indices.data()};
    py::gil_scoped_release release;
    if (!mesh.count) return;
    const kl::Shares shares(graph.rows, mesh, kl::lanes(), kl::wanted_threads());
    kl::parallel(static_cast<int64_t>(shares.size()),
                 [&](int64_t share) { add_groups(w, mesh, graph, shares, share); });
}

}  // namespace

PYBIND11_MODULE(_inertia, m) {
    kl::common(m);
    m.def("add", &add, "Add M, G and H of elements to the data of matrices, of those that are given",
          py::arg("points").noconvert(), py::arg("nodes").noconvert(), py::arg("N").noconvert(),
          py::arg("dN").noconvert(), py::arg("weights").noconvert(), py::arg("velocity").noconvert(),
          py::arg("indptr").noconvert(), py::arg("indices").noconvert(), py::arg("M") = py::none(),
          py::arg("G") = py::none(), py::arg("H") = py::none());
}
