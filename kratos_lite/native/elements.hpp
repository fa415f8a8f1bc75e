// Elements from NumPy arrays, and kernels over them.
//
// Arguments: points (n, 3) of the nodes, nodes (m, k) of the elements, and the tables of a rule: N (g, k),
// dN (g, k, 3) and weights (g).  A kernel takes elements [first, last) of a W, which is a Gauss or more.
// Nodal vectors are computed for chunks of elements by all threads and added element by element by one, so
// that results do not depend on the number of threads.

#pragma once
#include <pybind11/stl.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "arrays.hpp"
#include "gauss.hpp"

namespace kl {

constexpr int64_t GRAIN = 256;    // elements of one task
constexpr int64_t CHUNK = 16384;  // elements whose vectors are added together

using MaybeNumbers = const std::optional<Array<double>>&;

// Data of an array (rows, columns), or null of None.
inline const double* optional(MaybeNumbers array, int64_t rows, int64_t columns, const char* what) {
    if (!array) return nullptr;
    require(has_shape(*array, rows, columns), what);
    return array->data();
}

inline Gauss elements(Numbers points, Indices nodes, Numbers dN, Numbers weights) {
    require(points.ndim() == 2 && points.shape(1) == 3, "points must be (n, 3)");
    require(nodes.ndim() == 2, "nodes must be (m, k)");
    require(dN.ndim() == 3 && dN.shape(1) == nodes.shape(1) && dN.shape(2) == 3, "dN must be (g, k, 3)");
    require(weights.size() == dN.shape(0), "weights must be (g)");
    require(are_rows(nodes, points.shape(0)), "nodes must be rows of points");
    Gauss w{};
    w.points = points.data();
    w.nodes = nodes.data();
    w.k = static_cast<int>(nodes.shape(1));
    w.g = static_cast<int>(dN.shape(0));
    w.dN = dN.data();
    w.weights = weights.data();
    w.last = nodes.shape(0);
    return w;
}

inline Gauss elements(Numbers points, Indices nodes, Numbers N, Numbers dN, Numbers weights) {
    Gauss w = elements(points, nodes, dN, weights);
    require(has_shape(N, w.g, w.k), "N must be (g, k)");
    w.N = N.data();
    return w;
}

inline void add_field(Gauss& w, Numbers points, Numbers field) {
    require(has_shape(field, points.shape(0), 3), "a nodal field must be (n, 3)");
    w.field = field.data();
}

// Elements with displacements u (n, 3), C (6, 6) and a prestress (m, 6) or None.
inline Gauss strained(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u, Numbers C,
                      MaybeNumbers prestress) {
    Gauss w = elements(points, nodes, dN, weights);
    add_field(w, points, u);
    require(has_shape(C, 6, 6), "C must be (6, 6)");
    w.C = C.data();
    w.prestress = optional(prestress, w.last, 6, "prestress must be (m, 6)");
    return w;
}

// A kernel for elements [first, last), in tasks that do not depend on the number of threads.
template <class W>
void run(void (*kernel)(const W&), const W& w, int64_t first, int64_t last) {
    parallel_ranges(last - first, GRAIN, [&](int64_t from, int64_t to) {
        Space space(8 * w.vectors());
        W task = w;
        task.space = space.data();
        task.first = first + from;
        task.last = first + to;
        kernel(task);
    });
}

// The sum (n, WIDTH) of what a kernel finds for each node (k, WIDTH) of each element.
template <int WIDTH, class W>
Array<double> scattered(void (*kernel)(const W&), W w, Numbers points) {
    Array<double> total({static_cast<py::ssize_t>(points.shape(0)), static_cast<py::ssize_t>(WIDTH)});
    double* to = total.mutable_data();
    std::fill_n(to, total.size(), 0.0);
    py::gil_scoped_release release;
    std::vector<double> found(std::min(w.last, CHUNK) * w.k * WIDTH);
    w.out = found.data();
    for (w.origin = 0; w.origin < w.last; w.origin += CHUNK) {
        const int64_t last = std::min(w.last, w.origin + CHUNK);
        run(kernel, w, w.origin, last);
        const double* from = w.out;
        for (int64_t a = w.origin * w.k; a < last * w.k; ++a, from += WIDTH)
            for (int i = 0; i < WIDTH; ++i) to[static_cast<int64_t>(w.nodes[a]) * WIDTH + i] += from[i];
    }
    return total;
}

struct Totals {
    double sum = 0, largest = 0;
    int64_t element = 0;  // with the largest
};

// Sum and maximum of the two numbers that a kernel finds for an element; sums of GRAIN are added in order.
template <class W>
Totals totalled(void (*kernel)(const W&), W w) {
    py::gil_scoped_release release;
    std::vector<double> found(2 * w.last);
    w.out = found.data();
    run(kernel, w, 0, w.last);
    Totals total;
    for (int64_t start = 0; start < w.last; start += GRAIN) {
        double sum = 0;
        for (int64_t e = start; e < std::min(w.last, start + GRAIN); ++e) {
            sum += found[2 * e];
            if (found[2 * e + 1] > total.largest) {
                total.largest = found[2 * e + 1];
                total.element = e;
            }
        }
        total.sum += sum;
    }
    return total;
}

}  // namespace kl
