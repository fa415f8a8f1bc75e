// Everything that loops over Gauss points except the stiffness matrix, for elements of any shape.
//
// Arguments: points (n, 3) of the nodes, nodes (m, k) of the elements, and the tables of a rule: N (g, k),
// dN (g, k, 3) and weights (g).  Nodal vectors are computed for chunks of elements by all threads and
// added element by element by one, so that results do not depend on the number of threads.

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "gauss_kernels.hpp"

namespace {

using kl::Array;
using kl::Gauss;
using kl::require;
namespace py = pybind11;

using Floats = const Array<double>&;
using Rows = const Array<int32_t>&;
using Kernel = void (*)(const Gauss&);

constexpr int64_t GRAIN = 256;    // elements of one task
constexpr int64_t CHUNK = 16384;  // elements whose vectors are added together

bool has_shape(Floats array, int64_t rows, int64_t columns) {
    return array.ndim() == 2 && array.shape(0) == rows && array.shape(1) == columns;
}

// Elements and the tables that every kernel needs.
Gauss elements(Floats points, Rows nodes, Floats dN, Floats weights) {
    require(points.ndim() == 2 && points.shape(1) == 3, "points must be (n, 3)");
    require(nodes.ndim() == 2, "nodes must be (m, k)");
    require(dN.ndim() == 3 && dN.shape(1) == nodes.shape(1) && dN.shape(2) == 3, "dN must be (g, k, 3)");
    require(weights.size() == dN.shape(0), "weights must be (g)");
    int32_t low = 0, high = -1;
    for (int64_t i = 0; i < nodes.size(); ++i) {
        low = std::min(low, nodes.data()[i]);
        high = std::max(high, nodes.data()[i]);
    }
    require(low >= 0 && high < points.shape(0), "nodes must be rows of points");
    Gauss w{};
    w.points = points.data();
    w.nodes = nodes.data();
    w.k = static_cast<int>(nodes.shape(1));
    w.g = static_cast<int>(dN.shape(0));
    w.dN = dN.data();
    w.weights = weights.data();
    return w;
}

void add_shape_functions(Gauss& w, Floats N) {
    require(has_shape(N, w.g, w.k), "N must be (g, k)");
    w.N = N.data();
}

void add_field(Gauss& w, Floats points, Floats field) {
    require(has_shape(field, points.shape(0), 3), "a nodal field must be (n, 3)");
    w.field = field.data();
}

void add_law(Gauss& w, Rows nodes, Floats C, const py::object& prestress) {
    require(has_shape(C, 6, 6), "C must be (6, 6)");
    w.C = C.data();
    if (prestress.is_none()) return;
    require(Array<double>::check_(prestress), "prestress must be float (m, 6)");
    const auto given = py::reinterpret_borrow<Array<double>>(prestress);
    require(has_shape(given, nodes.shape(0), 6), "prestress must be (m, 6)");
    w.prestress = given.data();
}

// A kernel for elements [first, last), in tasks that do not depend on the number of threads.
void run(Kernel kernel, const Gauss& w, int64_t first, int64_t last) {
    kl::parallel_ranges(last - first, GRAIN, [&](int64_t from, int64_t to) {
        std::vector<double> space(8 * w.lanes() + 8);
        Gauss task = w;
        const auto misfit = reinterpret_cast<uintptr_t>(space.data()) % 64 / sizeof(double);
        task.space = space.data() + (8 - misfit) % 8;
        task.first = first + from;
        task.last = first + to;
        kernel(task);
    });
}

// Add what a kernel finds for each node (k, width) of each element to nodal vectors (n, width).
template <int WIDTH>
void scatter(Kernel kernel, Gauss w, int64_t m, double* total) {
    std::vector<double> found(std::min(m, CHUNK) * w.k * WIDTH);
    w.out = found.data();
    for (w.origin = 0; w.origin < m; w.origin += CHUNK) {
        const int64_t last = std::min(m, w.origin + CHUNK);
        run(kernel, w, w.origin, last);
        const double* from = w.out;
        for (int64_t a = w.origin * w.k; a < last * w.k; ++a, from += WIDTH)
            for (int i = 0; i < WIDTH; ++i) total[static_cast<int64_t>(w.nodes[a]) * WIDTH + i] += from[i];
    }
}

template <int WIDTH>
Array<double> scattered(Kernel kernel, const Gauss& w, Rows nodes, Floats points) {
    Array<double> total({static_cast<py::ssize_t>(points.shape(0)), static_cast<py::ssize_t>(WIDTH)});
    double* to = total.mutable_data();
    const int64_t m = nodes.shape(0);
    std::fill(to, to + total.size(), 0.0);
    py::gil_scoped_release release;
    scatter<WIDTH>(kernel, w, m, to);
    return total;
}

Array<double> per_element(Kernel kernel, Gauss w, std::vector<py::ssize_t> shape) {
    Array<double> out(shape);
    w.out = out.mutable_data();
    py::gil_scoped_release release;
    run(kernel, w, 0, shape[0]);
    return out;
}

Array<double> clearly_positive(Floats points, Rows nodes, Floats dN, Floats weights) {
    return per_element(kl::clearly_positive, elements(points, nodes, dN, weights), {nodes.shape(0)});
}

Array<double> volumes(Floats points, Rows nodes, Floats dN, Floats weights) {
    return per_element(kl::volumes, elements(points, nodes, dN, weights), {nodes.shape(0), dN.shape(0)});
}

Array<double> shares(Floats points, Rows nodes, Floats N, Floats dN, Floats weights) {
    Gauss w = elements(points, nodes, dN, weights);
    add_shape_functions(w, N);
    return scattered<1>(kl::shares, w, nodes, points);
}

py::tuple mass_sums(Floats points, Rows nodes, Floats N, Floats dN, Floats weights) {
    Gauss w = elements(points, nodes, dN, weights);
    add_shape_functions(w, N);
    Array<double> diagonal({nodes.shape(0), nodes.shape(1)});
    w.second = diagonal.mutable_data();
    return py::make_tuple(per_element(kl::shares, w, {nodes.shape(0), nodes.shape(1)}), diagonal);
}

Array<double> body_force(Floats points, Rows nodes, Floats N, Floats dN, Floats weights, Floats force) {
    Gauss w = elements(points, nodes, dN, weights);
    add_shape_functions(w, N);
    add_field(w, points, force);
    return scattered<3>(kl::body_force, w, nodes, points);
}

Gauss strained(Floats points, Rows nodes, Floats dN, Floats weights, Floats u, Floats C,
               const py::object& prestress) {
    Gauss w = elements(points, nodes, dN, weights);
    add_field(w, points, u);
    add_law(w, nodes, C, prestress);
    return w;
}

Array<double> stress(Floats points, Rows nodes, Floats dN, Floats weights, Floats u, Floats C,
                     py::object prestress) {
    const Gauss w = strained(points, nodes, dN, weights, u, C, prestress);
    return per_element(kl::stress, w, {nodes.shape(0), dN.shape(0), 6});
}

Array<double> internal_load(Floats points, Rows nodes, Floats dN, Floats weights, Floats u, Floats C,
                            py::object prestress) {
    const Gauss w = strained(points, nodes, dN, weights, u, C, prestress);
    return scattered<3>(kl::internal_load, w, nodes, points);
}

// Energy, largest von Mises stress and its element; sums of GRAIN elements are added in order.
py::tuple totals(Floats points, Rows nodes, Floats dN, Floats weights, Floats u, Floats C,
                 py::object prestress) {
    Gauss w = strained(points, nodes, dN, weights, u, C, prestress);
    const int64_t m = nodes.shape(0);
    double energy = 0, largest = 0;
    int64_t element = 0;
    {
        py::gil_scoped_release release;
        std::vector<double> found(2 * m);
        w.out = found.data();
        run(kl::totals, w, 0, m);
        for (int64_t start = 0; start < m; start += GRAIN) {
            double sum = 0;
            for (int64_t e = start; e < std::min(m, start + GRAIN); ++e) {
                sum += found[2 * e];
                if (found[2 * e + 1] > largest) {
                    largest = found[2 * e + 1];
                    element = e;
                }
            }
            energy += sum;
        }
    }
    return py::make_tuple(energy, std::sqrt(largest), element);
}

py::tuple averages(Floats points, Rows nodes, Floats dN, Floats weights, Floats u, Floats C,
                   py::object prestress, Floats to_nodes) {
    Gauss w = strained(points, nodes, dN, weights, u, C, prestress);
    require(has_shape(to_nodes, w.k, w.g), "to_nodes must be (k, g)");
    w.to_nodes = to_nodes.data();
    Array<double> means({nodes.shape(0), static_cast<py::ssize_t>(6)});
    w.second = means.mutable_data();
    return py::make_tuple(scattered<6>(kl::averages, w, nodes, points), means);
}

}  // namespace

PYBIND11_MODULE(_gauss, m) {
    kl::common(m);
    const auto points = py::arg("points").noconvert(), nodes = py::arg("nodes").noconvert();
    const auto N = py::arg("N").noconvert(), dN = py::arg("dN").noconvert();
    const auto weights = py::arg("weights").noconvert(), u = py::arg("u").noconvert();
    const auto C = py::arg("C").noconvert(), prestress = py::arg("prestress");
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
