// Large displacements: internal load, energy and stiffness of elements of any shape.
//
// Arguments: elements and tables as in elements.hpp, displacements q (n, 3), the increment dq (n, 3) of a
// step or None, C (6, 6), prestress (m, 6) or None.  Sums run over the elements in their order, whatever the
// number of threads.

#include "lagrange.hpp"

#include <cmath>
#include <optional>

#include "elements.hpp"

namespace {

using kl::Array;
using kl::Displaced;
using kl::Indices;
using kl::MaybeNumbers;
using kl::Numbers;
using kl::require;
namespace py = pybind11;

Displaced displaced(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers q, MaybeNumbers dq,
                    double damping, Numbers C, MaybeNumbers prestress) {
    return {kl::strained(points, nodes, dN, weights, q, C, prestress),
            kl::optional(dq, points.shape(0), 3, "dq must be (n, 3)"), damping, kl::Law(C.data())};
}

Array<double> internal_load(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers q,
                            MaybeNumbers dq, double damping, Numbers C, MaybeNumbers prestress) {
    const auto w = displaced(points, nodes, dN, weights, q, dq, damping, C, prestress);
    return kl::scattered<3>(kl::load_some, w, points);
}

// Energy and largest |E|.
py::tuple totals(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers q, Numbers C,
                 MaybeNumbers prestress) {
    const auto w = displaced(points, nodes, dN, weights, q, std::nullopt, 0, C, prestress);
    const auto found = kl::totalled(kl::totals_some, w);
    return py::make_tuple(found.sum, std::sqrt(found.largest));
}

void add_stiffness(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers q, MaybeNumbers dq,
                   double damping, Numbers C, MaybeNumbers prestress, Indices indptr, Indices indices,
                   Array<double> data) {
    const auto w = displaced(points, nodes, dN, weights, q, dq, damping, C, prestress);
    require(indptr.size() == points.shape(0) + 1, "the pattern must have a row for each point");
    require(data.size() == 9 * indices.size(), "data must be (nnz, 3, 3)");
    const kl::Graph graph{points.shape(0), indptr.data(), indices.data()};
    double* to = data.mutable_data();
    py::gil_scoped_release release;
    const int V = kl::lanes();
    kl::for_groups({w.nodes, w.last, w.k}, graph, V, kl::tangent_size(w, V),
                   [&](const kl::Group& group) { kl::add_tangent_group({group, w, to}); });
}

}  // namespace

PYBIND11_MODULE(_lagrange, m) {
    kl::common(m);
    const auto points = py::arg("points").noconvert(), nodes = py::arg("nodes").noconvert();
    const auto dN = py::arg("dN").noconvert(), weights = py::arg("weights").noconvert();
    const auto q = py::arg("q").noconvert(), C = py::arg("C").noconvert();
    const auto dq = py::arg("dq").noconvert(), prestress = py::arg("prestress").noconvert();
    const auto damping = py::arg("damping");
    m.def("internal_load", &internal_load, "∫ P grad N dV, (n, 3)", points, nodes, dN, weights, q, dq, damping,
          C, prestress);
    m.def("totals", &totals, "∫ (½ E:C:E + S0:E) dV and the largest |E|", points, nodes, dN, weights, q, C,
          prestress);
    m.def("add_stiffness", &add_stiffness, "Add the derivative of the load to the blocks of a matrix", points,
          nodes, dN, weights, q, dq, damping, C, prestress, py::arg("indptr").noconvert(),
          py::arg("indices").noconvert(), py::arg("data").noconvert());
}
