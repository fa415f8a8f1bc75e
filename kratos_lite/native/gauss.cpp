// Everything that loops over Gauss points except the stiffness matrix, for elements of any shape.

#include "elements.hpp"
#include "gauss_kernels.hpp"

namespace {

using namespace kl;

// Functions of elements as functions of arrays: of the geometry alone, with N, and with strains.
template <auto F>
auto of_geometry(Numbers points, Indices nodes, Numbers dN, Numbers weights) {
    return F(elements(points, nodes, dN, weights));
}

template <auto F>
auto of_weighted(Numbers points, Indices nodes, Numbers N, Numbers dN, Numbers weights) {
    return F(elements(points, nodes, N, dN, weights));
}

template <auto F>
auto of_strained(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u, Numbers C,
                 MaybeNumbers prestress, const MaybeTables& addition) {
    return F(strained(points, nodes, dN, weights, u, C, prestress, addition));
}

auto positive_elements(const Elements& w) { return per_element(clearly_positive, w, {w.last}); }
auto point_volumes(const Elements& w) { return per_element(volumes, w, {w.last, w.g}); }
auto shares(const Elements& w) { return scattered<1>(row_sums, w); }
auto stresses(const Elements& w) { return per_element(stress, w, {w.last, w.g, 6}); }
auto load(const Elements& w) { return scattered<3>(internal_load, w); }

auto mass_sums(const Elements& given) {
    Elements w = given;
    Array<double> diagonal({w.last, static_cast<int64_t>(w.k)});
    w.second = diagonal.mutable_data();
    return std::make_tuple(per_element(row_sums, w, {w.last, w.k}), diagonal);
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

auto nodal_stress(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u, Numbers C,
                       MaybeNumbers prestress, const MaybeTables& addition, Numbers to_nodes) {
    Elements w = strained(points, nodes, dN, weights, u, C, prestress, addition);
    require(has_shape(to_nodes, w.k, w.g), "to_nodes must be (k, g)");
    w.to_nodes = to_nodes.data();
    Array<double> means({w.last, int64_t{6}});
    w.second = means.mutable_data();
    return std::make_tuple(scattered<6>(averages, w), means);
}

auto energy_and_stress(const Elements& w) {
    const Totals found = totaled(totals, w);
    return std::make_tuple(found.sum, std::sqrt(found.largest), found.element);
}

}  // namespace

KL_MODULE(_gauss, m) {
    const std::vector<Parameter> geometry = {"points", "nodes", "dN", "weights"};
    define<&of_geometry<positive_elements>>(m, "clearly_positive",
                                            "1 for elements with det J clearly > 0 everywhere, else 0: (m,)", geometry);
    define<&interpolated_nodes>(m, "interpolated", "1 for elements with X = C X[base] to near |X|, else 0: (m,)",
                                {"points", "nodes", "base", "C", "near"});
    define<&of_geometry<point_volumes>>(m, "volumes", "γ det J (m, g)", geometry);
    const std::vector<Parameter> weighted = {"points", "nodes", "N", "dN", "weights"};
    define<&of_weighted<shares>>(m, "shares", "∫ N dV of each node, (n, 1)", weighted);
    define<&of_weighted<mass_sums>>(m, "mass_sums", "row sums and diagonal of ∫ N N dV, each (m, k)", weighted);
    const std::vector<Parameter> strains = {"points", "nodes", "dN", "weights", "u", "C", "prestress", "addition"};
    define<&of_strained<stresses>>(m, "stress", "C ε + σ0 (m, g, 6)", strains);
    define<&of_strained<load>>(m, "internal_load", "∫ B^T (C ε + σ0) dV, (n, 3)", strains);
    define<&of_strained<energy_and_stress>>(m, "totals", "½ ∫ ε C ε dV, largest von Mises stress, its element", strains);
    define<&nodal_force>(m, "body_force", "∫ N b dV of a nodal b, (n, 3)",
                         {"points", "nodes", "N", "dN", "weights", "force"});
    define<&nodal_stress>(m, "averages", "sum of nodal stresses (n, 6), mean of each element (m, 6)",
                          {"points", "nodes", "dN", "weights", "u", "C", "prestress", "addition", "to_nodes"});
}
