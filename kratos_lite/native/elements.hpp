// Elements from NumPy arrays, and kernels over them.
//
// Arguments: points (n, 3) of the nodes, nodes (m, k) of the elements, and the tables of a rule: N (g, k),
// dN (g, k, 3) and weights (g).  A kernel takes elements [first, last) of them.
// Nodal vectors are computed for batches of elements by all threads and added element by element by one, so
// that results do not depend on the number of threads.

#pragma once
#include <algorithm>
#include <optional>
#include <tuple>
#include <vector>

#include "arrays.hpp"
#include "gauss.hpp"

namespace kl {

constexpr int64_t GRAIN = 256;    // elements of one task
constexpr int64_t BATCH = 16384;  // elements whose vectors are added together

inline Elements elements(Numbers points, Indices nodes) {
    require(points.ndim() == 2 && points.shape(1) == 3, "points must be (n, 3)");
    require(nodes.ndim() == 2, "nodes must be (m, k)");
    require(are_rows(nodes, points.shape(0)), "nodes must be rows of points");
    Elements w{};
    w.points = points.data();
    w.n = points.shape(0);
    w.nodes = nodes.data();
    w.k = static_cast<int>(nodes.shape(1));
    w.last = nodes.shape(0);
    return w;
}

inline Elements elements(Numbers points, Indices nodes, Numbers dN, Numbers weights) {
    Elements w = elements(points, nodes);
    require(dN.ndim() == 3 && dN.shape(1) == nodes.shape(1) && dN.shape(2) == 3, "dN must be (g, k, 3)");
    require(weights.size() == dN.shape(0), "weights must be (g)");
    w.g = static_cast<int>(dN.shape(0));
    w.dN = dN.data();
    w.weights = weights.data();
    return w;
}

inline Elements elements(Numbers points, Indices nodes, Numbers N, Numbers dN, Numbers weights) {
    Elements w = elements(points, nodes, dN, weights);
    require(has_shape(N, w.g, w.k), "N must be (g, k)");
    w.N = N.data();
    return w;
}

inline void add_field(Elements& w, Numbers field) {
    require(has_shape(field, w.n, 3), "a nodal field must be (n, 3)");
    w.field = field.data();
}

// What elements add to their strain: dN at the center (k, 3); monomials (g, 6) of enhanced modes, or functions
// (g, k or 0) of the dilatation; C (6, 6) of the modes, or None; share of the dilatation that is projected.
using Tables = std::tuple<Array<double>, Array<double>, std::optional<Array<double>>, double>;
using MaybeTables = std::optional<Tables>;

inline Addition added(const Elements& w, const Tables& tables) {
    const auto& [center, functions, C, share] = tables;
    Addition found;
    require(has_shape(center, w.k, 3), "dN at the center must be (k, 3)");
    found.center = center.data();
    found.functions = functions.data();
    found.share = share;
    if (!C) {
        found.kind = Addition::dilatation;
        found.terms = functions.size() ? 4 : 1;
        require(has_shape(functions, w.g, found.terms == 1 ? 0 : w.k), "functions must be (g, k) or (g, 0)");
        return found;
    }
    found.kind = Addition::modes;
    require(w.k == 8 && has_shape(functions, w.g, 6), "modes need eight nodes and monomials (g, 6)");
    require(has_shape(*C, 6, 6), "C of the modes must be (6, 6)");
    found.law = Law(C->data());
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < i; ++j) {
            double sum = 0;
            for (int q = 0; q < w.g; ++q) sum += w.weights[q] * functions.at(q, i) * functions.at(q, j);
            found.orthogonal &= std::fabs(sum) < 1e-12;
        }
    return found;
}

inline void set_law(Elements& w, Numbers C, const MaybeTables& addition) {
    require(has_shape(C, 6, 6), "C must be (6, 6)");
    w.law = Law(C.data());
    if (addition) w.addition = added(w, *addition);
}

// Elements with displacements u (n, 3), C (6, 6), and None, a prestress (m, 6), or (m, 7) with a factor of C.
inline Elements strained(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u, Numbers C,
                         MaybeNumbers prestress, const MaybeTables& addition = {}) {
    Elements w = elements(points, nodes, dN, weights);
    add_field(w, u);
    set_law(w, C, addition);
    w.initial = prestress ? prestress->ndim() == 2 && prestress->shape(1) == 7 ? 7 : 6 : 0;
    w.prestress = optional(prestress, w.last, w.initial, "prestress must be (m, 6) or (m, 7)");
    return w;
}

using Kernel = void (*)(const Elements&);

// A kernel for elements [first, last), in tasks that do not depend on the number of threads.
inline void run(Kernel kernel, const Elements& w, int64_t first, int64_t last) {
    parallel_ranges(last - first, GRAIN, [&](int64_t from, int64_t to) {
        Workspace space(8 * w.vectors());
        Elements task = w;
        task.space = space.data();
        task.first = first + from;
        task.last = first + to;
        kernel(task);
    });
}

// What a kernel finds for each element: rows of an array of this shape.
inline Array<double> per_element(Kernel kernel, Elements w, std::initializer_list<int64_t> shape) {
    Array<double> out(shape);
    w.out = out.mutable_data();
    GilReleased release;
    run(kernel, w, 0, w.last);
    return out;
}

// The sum (n, width) of what a kernel finds for each node (k, width) of each element.
template <int width>
Array<double> scattered(Kernel kernel, Elements w) {
    Array<double> total({w.n, int64_t{width}});
    double* to = total.mutable_data();
    std::fill_n(to, total.size(), 0.0);
    GilReleased release;
    std::vector<double> found(std::min(w.last, BATCH) * w.k * width);
    w.out = found.data();
    for (w.origin = 0; w.origin < w.last; w.origin += BATCH) {
        const int64_t last = std::min(w.last, w.origin + BATCH);
        run(kernel, w, w.origin, last);
        const double* from = w.out;
        for (int64_t a = w.origin * w.k; a < last * w.k; ++a, from += width)
            for (int i = 0; i < width; ++i) to[static_cast<int64_t>(w.nodes[a]) * width + i] += from[i];
    }
    return total;
}

struct Totals {
    double sum = 0, largest = 0;
    int64_t element = 0;  // with the largest
};

// Sum and maximum of the two numbers that a kernel finds for an element; sums of GRAIN are added in order.
inline Totals totaled(Kernel kernel, Elements w) {
    GilReleased release;
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
