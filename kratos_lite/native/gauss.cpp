// Everything that loops over Gauss points except the stiffness matrix, for elements of any shape.

#include <cmath>
#include <vector>

#include "elements.hpp"
#include "gauss_kernels.hpp"

namespace {

using kl::Array;
using kl::elements;
using kl::Gauss;
using kl::Indices;
using kl::MaybeNumbers;
using kl::Numbers;
using kl::scattered;
using kl::strained;
namespace py = pybind11;

Array<double> per_element(void (*kernel)(const Gauss&), Gauss w, std::vector<py::ssize_t> shape) {
    Array<double> out(shape);
    w.out = out.mutable_data();
    py::gil_scoped_release release;
    kl::run(kernel, w, 0, w.last);
    return out;
}

Array<double> clearly_positive(Numbers points, Indices nodes, Numbers dN, Numbers weights) {
    return per_element(kl::clearly_positive, elements(points, nodes, dN, weights), {nodes.shape(0)});
}

Array<double> volumes(Numbers points, Indices nodes, Numbers dN, Numbers weights) {
    return per_element(kl::volumes, elements(points, nodes, dN, weights), {nodes.shape(0), dN.shape(0)});
}

Array<double> shares(Numbers points, Indices nodes, Numbers N, Numbers dN, Numbers weights) {
    return scattered<1>(kl::shares, elements(points, nodes, N, dN, weights), points);
}

py::tuple mass_sums(Numbers points, Indices nodes, Numbers N, Numbers dN, Numbers weights) {
    Gauss w = elements(points, nodes, N, dN, weights);
    Array<double> diagonal({nodes.shape(0), nodes.shape(1)});
    w.second = diagonal.mutable_data();
    return py::make_tuple(per_element(kl::shares, w, {nodes.shape(0), nodes.shape(1)}), diagonal);
}

Array<double> body_force(Numbers points, Indices nodes, Numbers N, Numbers dN, Numbers weights,
                         Numbers force) {
    Gauss w = elements(points, nodes, N, dN, weights);
    kl::add_field(w, points, force);
    return scattered<3>(kl::body_force, w, points);
}

Array<double> stress(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u, Numbers C,
                     MaybeNumbers prestress) {
    const Gauss w = strained(points, nodes, dN, weights, u, C, prestress);
    return per_element(kl::stress, w, {nodes.shape(0), dN.shape(0), 6});
}

Array<double> internal_load(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u, Numbers C,
                            MaybeNumbers prestress) {
    return scattered<3>(kl::internal_load, strained(points, nodes, dN, weights, u, C, prestress), points);
}

// Energy, largest von Mises stress and its element.
py::tuple totals(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u, Numbers C,
                 MaybeNumbers prestress) {
    const auto found = kl::totalled(kl::totals, strained(points, nodes, dN, weights, u, C, prestress));
    return py::make_tuple(found.sum, std::sqrt(found.largest), found.element);
}

py::tuple averages(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u, Numbers C,
                   MaybeNumbers prestress, Numbers to_nodes) {
    Gauss w = strained(points, nodes, dN, weights, u, C, prestress);
    kl::require(kl::has_shape(to_nodes, w.k, w.g), "to_nodes must be (k, g)");
    w.to_nodes = to_nodes.data();
    Array<double> means({nodes.shape(0), static_cast<py::ssize_t>(6)});
    w.second = means.mutable_data();
    return py::make_tuple(scattered<6>(kl::averages, w, points), means);
}

}  // namespace

PYBIND11_MODULE(_gauss, m) {
    kl::common(m);
    const auto points = py::arg("points").noconvert(), nodes = py::arg("nodes").noconvert();
    const auto N = py::arg("N").noconvert(), dN = py::arg("dN").noconvert();
    const auto weights = py::arg("weights").noconvert(), u = py::arg("u").noconvert();
    const auto C = py::arg("C").noconvert(), prestress = py::arg("prestress").noconvert();
    m.def("clearly_positive", &clearly_positive, "1 for elements with det J clearly > 0 everywhere, else 0: (m,)",
          points, nodes, dN, weights);
    m.def("volumes", &volumes, "γ det J (m, g)", points, nodes, dN, weights);
    m.def("shares", &shares, "∫ N dV of each node, (n, 1)", points, nodes, N, dN, weights);
    m.def("mass_sums", &mass_sums, "row sums and diagonal of ∫ N N dV, each (m, k)", points, nodes, N, dN,
          weights);
    m.def("body_force", &body_force, "∫ N b dV of a nodal b, (n, 3)", points, nodes, N, dN, weights,
          py::arg("force").noconvert());
    m.def("stress", &stress, "C ε + σ0 (m, g, 6)", points, nodes, dN, weights, u, C, prestress);
    m.def("internal_load", &internal_load, "∫ B^T (C ε + σ0) dV, (n, 3)", points, nodes, dN, weights, u, C,
          prestress);
    m.def("totals", &totals, "½ ∫ ε C ε dV, largest von Mises stress, its element", points, nodes, dN, weights,
          u, C, prestress);
    m.def("averages", &averages, "sum of nodal stresses (n, 6), mean of each element (m, 6)", points, nodes, dN,
          weights, u, C, prestress, py::arg("to_nodes").noconvert());
}
