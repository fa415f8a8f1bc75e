// Matrices of mass at rest or in flow, M, G and H, for elements of any shape.
//
// Arguments: elements and tables as in elements.hpp with weights times ρ, the velocity c = A X + b as (3, 4),
// the pattern, and data (nnz,) of each matrix or None.  Sums run over the elements in their order, whatever
// the number of threads.

#include "inertia.hpp"

#include <optional>

#include "elements.hpp"

namespace {

using kl::Array;
using kl::Indices;
using kl::Numbers;
using kl::require;
namespace py = pybind11;

using Data = std::optional<Array<double>>;

double* optional(Data& array, Indices indices) {
    require(!array || array->size() == indices.size(), "data must be float (nnz,)");
    return array ? array->mutable_data() : nullptr;
}

void add(Numbers points, Indices nodes, Numbers N, Numbers dN, Numbers weights, Numbers velocity,
         Indices indptr, Indices indices, Data M, Data G, Data H) {
    kl::Inertia w{kl::elements(points, nodes, N, dN, weights), velocity.data(), {},
                  optional(M, indices), optional(G, indices), optional(H, indices)};
    require(kl::has_shape(velocity, 3, 4), "velocity must be (3, 4)");
    require(indptr.size() == points.shape(0) + 1, "the pattern must have a row for each point");
    w.wide.assign(static_cast<int64_t>(w.g) * w.wide_k(), 0.0);
    for (int q = 0; q < w.g; ++q) std::copy_n(w.N + q * w.k, w.k, w.wide.data() + q * w.wide_k());
    const kl::Graph graph{points.shape(0), indptr.data(), indices.data()};
    py::gil_scoped_release release;
    const int V = kl::lanes();
    kl::for_groups({w.nodes, w.last, w.k}, graph, V, kl::inertia_size(w, V),
                   [&](const kl::Group& group) { kl::add_inertia_group({group, w}); });
}

}  // namespace

PYBIND11_MODULE(_inertia, m) {
    kl::common(m);
    m.def("add", &add, "Add M, G and H of elements to the data of matrices, of those that are given",
          py::arg("points").noconvert(), py::arg("nodes").noconvert(), py::arg("N").noconvert(),
          py::arg("dN").noconvert(), py::arg("weights").noconvert(), py::arg("velocity").noconvert(),
          py::arg("indptr").noconvert(), py::arg("indices").noconvert(), py::arg("M").noconvert() = py::none(),
          py::arg("G").noconvert() = py::none(), py::arg("H").noconvert() = py::none());
}
