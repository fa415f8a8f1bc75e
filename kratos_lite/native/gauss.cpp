// Everything that loops over Gauss points except the stiffness matrix, for elements of any shape.

#include "elements.hpp"
#include "gauss_kernels.hpp"

namespace {

using namespace kl;

// Functions of elements as functions of arrays: of the geometry alone, with N, and with strains.
template <class F>
auto of_geometry(F f) {
    return [f](Numbers points, Indices nodes, Numbers dN, Numbers weights) {
        return f(elements(points, nodes, dN, weights));
    };
}

template <class F>
auto of_weighted(F f) {
    return [f](Numbers points, Indices nodes, Numbers N, Numbers dN, Numbers weights) {
        return f(elements(points, nodes, N, dN, weights));
    };
}

template <class F>
auto of_strained(F f) {
    return [f](Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u, Numbers C,
               MaybeNumbers prestress, const MaybeTables& addition) {
        return f(strained(points, nodes, dN, weights, u, C, prestress, addition));
    };
}

py::tuple mass_sums(Elements w) {
    Array<double> diagonal({w.last, static_cast<int64_t>(w.k)});
    w.second = diagonal.mutable_data();
    return py::make_tuple(per_element(row_sums, w, {w.last, w.k}), diagonal);
}

Array<double> nodal_force(Numbers points, Indices nodes, Numbers N, Numbers dN, Numbers weights, Numbers force) {
    Elements w = elements(points, nodes, N, dN, weights);
    add_field(w, force);
    return scattered<3>(body_force, w);
}

Array<double> interpolated_nodes(Numbers points, Indices nodes, Indices base, Numbers C, double near) {
    Elements w = elements(points, nodes);
    require(has_shape(C, w.k, base.size()), "C must be (k, b)");
    require(are_rows(base, w.k), "base must be nodes of an element");
    w.g = static_cast<int>(base.size());
    w.base = base.data();
    w.to_nodes = C.data();
    w.near = near;
    return per_element(interpolated, w, {w.last});
}

py::tuple nodal_stress(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u, Numbers C,
                       MaybeNumbers prestress, const MaybeTables& addition, Numbers to_nodes) {
    Elements w = strained(points, nodes, dN, weights, u, C, prestress, addition);
    require(has_shape(to_nodes, w.k, w.g), "to_nodes must be (k, g)");
    w.to_nodes = to_nodes.data();
    Array<double> means({w.last, int64_t{6}});
    w.second = means.mutable_data();
    return py::make_tuple(scattered<6>(averages, w), means);
}

py::tuple energy_and_stress(const Elements& w) {
    const Totals found = totaled(totals, w);
    return py::make_tuple(found.sum, std::sqrt(found.largest), found.element);
}

}  // namespace

PYBIND11_MODULE(_gauss, m) {
    common(m);
    const auto geometry = [&](const char* name, auto f, const char* doc) {
        define(m, name, of_geometry(f), doc, "points", "nodes", "dN", "weights");
    };
    const auto weighted = [&](const char* name, auto f, const char* doc) {
        define(m, name, of_weighted(f), doc, "points", "nodes", "N", "dN", "weights");
    };
    const auto strains = [&](const char* name, auto f, const char* doc) {
        define(m, name, of_strained(f), doc, "points", "nodes", "dN", "weights", "u", "C", "prestress",
               "addition");
    };
    geometry("clearly_positive", [](const Elements& w) { return per_element(clearly_positive, w, {w.last}); },
             "1 for elements with det J clearly > 0 everywhere, else 0: (m,)");
    define(m, "interpolated", interpolated_nodes, "1 for elements with X = C X[base] to near |X|, else 0: (m,)",
           "points", "nodes", "base", "C", py::arg("near"));
    geometry("volumes", [](const Elements& w) { return per_element(volumes, w, {w.last, w.g}); }, "γ det J (m, g)");
    weighted("shares", [](const Elements& w) { return scattered<1>(row_sums, w); }, "∫ N dV of each node, (n, 1)");
    weighted("mass_sums", mass_sums, "row sums and diagonal of ∫ N N dV, each (m, k)");
    strains("stress", [](const Elements& w) { return per_element(stress, w, {w.last, w.g, 6}); },
            "C ε + σ0 (m, g, 6)");
    strains("internal_load", [](const Elements& w) { return scattered<3>(internal_load, w); },
            "∫ B^T (C ε + σ0) dV, (n, 3)");
    strains("totals", energy_and_stress, "½ ∫ ε C ε dV, largest von Mises stress, its element");
    define(m, "body_force", nodal_force, "∫ N b dV of a nodal b, (n, 3)", "points", "nodes", "N", "dN", "weights",
           "force");
    define(m, "averages", nodal_stress, "sum of nodal stresses (n, 6), mean of each element (m, 6)", "points",
           "nodes", "dN", "weights", "u", "C", "prestress", "addition", "to_nodes");
}
