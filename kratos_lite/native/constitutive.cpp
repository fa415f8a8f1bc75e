// Any constitutive law: strains for it, and internal forces and stiffness of what it gives.
//
// Arguments: elements and tables as in elements.hpp, displacements u (n, 3); stress (m, g, 6), tangent
// (m, g, 6, 6) and delta (m, g, k, 3) or None at the Gauss points; whether strains are finite, and whether the
// tangent is symmetric.

#include "constitutive.hpp"

#include "elements.hpp"

namespace {

using namespace kl;

Elements displaced(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u) {
    Elements w = elements(points, nodes, dN, weights);
    add_field(w, u);
    return w;
}

LawValues given_by(const Elements& w, Numbers stress, MaybeNumbers delta, bool finite) {
    LawValues given;
    require(stress.size() == w.last * w.g * 6, "stress must be (m, g, 6)");
    require(!delta || delta->size() == w.last * w.g * w.k * 3, "delta must be (m, g, k, 3)");
    given.stress = stress.data();
    given.delta = delta ? delta->data() : nullptr;
    given.finite = finite;
    return given;
}

Array<double> green(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u) {
    const Elements w = displaced(points, nodes, dN, weights, u);
    return per_element(green_strain, w, {w.last, w.g, 7});
}

Array<double> internal_load(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u, Numbers stress,
                            MaybeNumbers delta, bool finite) {
    Elements w = displaced(points, nodes, dN, weights, u);
    const LawValues given = given_by(w, stress, delta, finite);
    w.given = &given;
    return scattered<3>(given_load, w);
}

void add_stiffness(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers u, Numbers stress,
                   Numbers tangent, MaybeNumbers delta, bool finite, bool symmetric, Indices indptr, Indices indices,
                   Array<double> data) {
    Elements w = displaced(points, nodes, dN, weights, u);
    LawValues given = given_by(w, stress, delta, finite);
    require(tangent.size() == w.last * w.g * 36, "tangent must be (m, g, 6, 6)");
    given.tangent = tangent.data();
    given.symmetric = symmetric;
    w.given = &given;
    const Graph graph = pattern(indptr, indices, w.n);
    require(data.size() == 9 * indices.size(), "data must be (nnz, 3, 3)");
    double* to = data.mutable_data();
    GilReleased release;
    const int V = vector_width();
    for_chunks({w.nodes, w.last, w.k}, graph, V, given_size(w, V), [&](const Chunk& chunk) {
        dispatch<double>([&](auto V) KL_INLINE_LAMBDA { add_given<V>(w, chunk, to); });
    });
}

}  // namespace

KL_MODULE(_constitutive, m) {
    define<&green>(m, "green", "Green's strain and det F, (m, g, 7)", {"points", "nodes", "dN", "weights", "u"});
    define<&internal_load>(m, "internal_load", "∫ B^T σ dV of given stresses, (n, 3)",
                           {"points", "nodes", "dN", "weights", "u", "stress", "delta", "finite"});
    define<&add_stiffness>(m, "add_stiffness", "Add the stiffness of given stresses and tangents to a matrix",
                           {"points", "nodes", "dN", "weights", "u", "stress", "tangent", "delta", "finite",
                            "symmetric", "indptr", "indices", "data"});
}
