// Large displacements: internal load, energy and stiffness of elements of any shape.
//
// Arguments: points (n, 3) of the nodes, nodes (m, k) of the elements, dN (g, k, 3) and weights (g) of a
// rule, displacements q (n, 3), the increment dq (n, 3) of a step or None, C (6, 6), prestress (m, 6) or
// None.  Sums run over the elements in their order, whatever the number of threads.

#include "lagrange.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "arrays.hpp"

namespace {

using kl::Array;
using kl::Displaced;
using kl::require;
namespace py = pybind11;

using Floats = const Array<double>&;
using Rows = const Array<int32_t>&;

constexpr int64_t GRAIN = 256;    // elements of one task
constexpr int64_t CHUNK = 16384;  // elements whose vectors are added together

// Data of an array (rows, columns), or null of None.
const double* optional(const py::object& array, int64_t rows, int64_t columns, const char* what) {
    if (array.is_none()) return nullptr;
    require(Array<double>::check_(array), what);
    const auto given = py::reinterpret_borrow<Array<double>>(array);
    require(given.ndim() == 2 && given.shape(0) == rows && given.shape(1) == columns, what);
    return given.data();
}

Displaced displaced(Floats points, Rows nodes, Floats dN, Floats weights, Floats q, const py::object& dq,
                    double damping, Floats C, const py::object& prestress) {
    const int64_t n = points.shape(0);
    require(points.ndim() == 2 && points.shape(1) == 3, "points must be (n, 3)");
    require(nodes.ndim() == 2, "nodes must be (m, k)");
    require(dN.ndim() == 3 && dN.shape(1) == nodes.shape(1) && dN.shape(2) == 3, "dN must be (g, k, 3)");
    require(weights.size() == dN.shape(0), "weights must be (g)");
    require(q.ndim() == 2 && q.shape(0) == n && q.shape(1) == 3, "q must be (n, 3)");
    require(C.ndim() == 2 && C.shape(0) == 6 && C.shape(1) == 6, "C must be (6, 6)");
    for (int64_t i = 0; i < nodes.size(); ++i)
        require(static_cast<uint32_t>(nodes.data()[i]) < n, "nodes must be rows of points");
    Displaced w{};
    w.points = points.data();
    w.nodes = nodes.data();
    w.k = static_cast<int>(nodes.shape(1));
    w.g = static_cast<int>(dN.shape(0));
    w.dN = dN.data();
    w.weights = weights.data();
    w.field = q.data();
    w.increment = optional(dq, n, 3, "dq must be float (n, 3)");
    w.damping = damping;
    w.law = kl::Law(C.data());
    w.prestress = optional(prestress, nodes.shape(0), 6, "prestress must be float (m, 6)");
    w.last = nodes.shape(0);
    return w;
}

// Room for some numbers from an address that suits vectors.
class Space {
public:
    explicit Space(int64_t size) : numbers(size + 8) {}
    double* data() {
        const auto misfit = reinterpret_cast<uintptr_t>(numbers.data()) % 64 / sizeof(double);
        return numbers.data() + (8 - misfit) % 8;
    }

private:
    std::vector<double> numbers;
};

// A kernel for elements [first, last), in tasks that do not depend on the number of threads.
void run(void (*kernel)(const Displaced&), const Displaced& w, int64_t first, int64_t last) {
    kl::parallel_ranges(last - first, GRAIN, [&](int64_t from, int64_t to) {
        Space space(8 * w.lanes());
        Displaced task = w;
        task.space = space.data();
        task.first = first + from;
        task.last = first + to;
        kernel(task);
    });
}

Array<double> internal_load(Floats points, Rows nodes, Floats dN, Floats weights, Floats q, py::object dq,
                            double damping, Floats C, py::object prestress) {
    Displaced w = displaced(points, nodes, dN, weights, q, dq, damping, C, prestress);
    Array<double> total({points.shape(0), points.shape(1)});
    double* to = total.mutable_data();
    std::fill(to, to + total.size(), 0.0);
    py::gil_scoped_release release;
    const int64_t m = w.last;
    std::vector<double> found(std::min(m, CHUNK) * w.k * 3);
    w.out = found.data();
    for (w.origin = 0; w.origin < m; w.origin += CHUNK) {
        const int64_t last = std::min(m, w.origin + CHUNK);
        run(kl::load_some, w, w.origin, last);
        const double* from = w.out;
        for (int64_t a = w.origin * w.k; a < last * w.k; ++a, from += 3)
            for (int i = 0; i < 3; ++i) to[3 * static_cast<int64_t>(w.nodes[a]) + i] += from[i];
    }
    return total;
}

// Energy and largest |E|; sums of GRAIN elements are added in order.
py::tuple totals(Floats points, Rows nodes, Floats dN, Floats weights, Floats q, Floats C,
                 py::object prestress) {
    Displaced w = displaced(points, nodes, dN, weights, q, py::none(), 0, C, prestress);
    double energy = 0, largest = 0;
    {
        py::gil_scoped_release release;
        std::vector<double> found(2 * w.last);
        w.out = found.data();
        run(kl::totals_some, w, 0, w.last);
        for (int64_t start = 0; start < w.last; start += GRAIN) {
            double sum = 0;
            for (int64_t e = start; e < std::min(w.last, start + GRAIN); ++e) {
                sum += found[2 * e];
                largest = std::max(largest, found[2 * e + 1]);
            }
            energy += sum;
        }
    }
    return py::make_tuple(energy, std::sqrt(largest));
}

void add_groups(const Displaced& w, const kl::Connectivity& mesh, const kl::Graph& graph,
                const kl::Shares& shares, int64_t share, double* data) {
    const int V = kl::lanes();
    const int64_t pairs = static_cast<int64_t>(V) * w.k * w.k;  // of a group
    const int64_t block = std::max<int64_t>(8, kl::BLOCK_PAIRS / pairs);
    kl::Places places(graph, mesh, shares, share, block * V);
    Space work(kl::tangent_size(w, V));
    std::vector<int64_t> elements(block * V);
    const auto& groups = shares.groups(share);
    const int64_t total = static_cast<int64_t>(groups.size());
    for (int64_t from = 0; from < total; from += block) {
        const int64_t count = std::min(block, total - from);
        for (int64_t i = 0; i < count * V; ++i)
            elements[i] = static_cast<int64_t>(groups[from + i / V]) * V + i % V;
        const int32_t* place = places.find(elements.data(), count * V);
        for (int64_t i = 0; i < count; ++i)
            kl::add_tangent_group({w, elements[i * V], data, work.data(), place + i * pairs,
                                   i + 1 < count ? pairs : 0});
    }
}

void add_stiffness(Floats points, Rows nodes, Floats dN, Floats weights, Floats q, py::object dq,
                   double damping, Floats C, py::object prestress, Rows indptr, Rows indices,
                   Array<double> data) {
    const Displaced w = displaced(points, nodes, dN, weights, q, dq, damping, C, prestress);
    require(indptr.size() == points.shape(0) + 1, "the pattern must have a row for each point");
    require(data.size() == 9 * indices.size(), "data must be (nnz, 3, 3)");
    const kl::Connectivity mesh{w.nodes, w.last, w.k};
    const kl::Graph graph{points.shape(0), indptr.data(), indices.data()};
    double* to = data.mutable_data();
    py::gil_scoped_release release;
    if (!mesh.count) return;
    const kl::Shares shares(graph.rows, mesh, kl::lanes(), kl::wanted_threads());
    kl::parallel(static_cast<int64_t>(shares.size()),
                 [&](int64_t share) { add_groups(w, mesh, graph, shares, share, to); });
}

}  // namespace

PYBIND11_MODULE(_lagrange, m) {
    kl::common(m);
    const auto points = py::arg("points").noconvert(), nodes = py::arg("nodes").noconvert();
    const auto dN = py::arg("dN").noconvert(), weights = py::arg("weights").noconvert();
    const auto q = py::arg("q").noconvert(), C = py::arg("C").noconvert();
    const auto dq = py::arg("dq"), damping = py::arg("damping"), prestress = py::arg("prestress");
    m.def("internal_load", &internal_load, "∫ P grad N dV, (n, 3)", points, nodes, dN, weights, q, dq, damping,
          C, prestress);
    m.def("totals", &totals, "∫ (½ E:C:E + S0:E) dV and the largest |E|", points, nodes, dN, weights, q, C,
          prestress);
    m.def("add_stiffness", &add_stiffness, "Add the derivative of the load to the blocks of a matrix", points,
          nodes, dN, weights, q, dq, damping, C, prestress, py::arg("indptr").noconvert(),
          py::arg("indices").noconvert(), py::arg("data").noconvert());
}
