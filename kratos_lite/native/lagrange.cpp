// Large displacements: internal load, energy and stiffness of elements of any shape.
//
// Arguments: elements and tables as in elements.hpp, displacements q (n, 3), the increment dq (n, 3) of a
// step or None, C (6, 6), prestress (m, 6) or None.  Sums run over the elements in their order, whatever the
// number of threads.

#include "lagrange.hpp"

#include "elements.hpp"

namespace {

using namespace kl;

Elements displaced(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers q, MaybeNumbers dq,
                   double damping, Numbers C, MaybeNumbers prestress) {
    Elements w = strained(points, nodes, dN, weights, q, C, prestress);
    w.increment = optional(dq, w.n, 3, "dq must be (n, 3)");
    w.damping = damping;
    return w;
}

Array<double> internal_load(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers q,
                            MaybeNumbers dq, double damping, Numbers C, MaybeNumbers prestress) {
    return scattered<3>(lagrange_load, displaced(points, nodes, dN, weights, q, dq, damping, C, prestress));
}

// Energy and largest |E|.
auto totals(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers q, Numbers C,
                 MaybeNumbers prestress) {
    const Totals found = totaled(lagrange_totals, strained(points, nodes, dN, weights, q, C, prestress));
    return std::make_tuple(found.sum, std::sqrt(found.largest));
}

void add_stiffness(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers q, MaybeNumbers dq,
                   double damping, Numbers C, MaybeNumbers prestress, Indices indptr, Indices indices,
                   Array<double> data) {
    const Elements w = displaced(points, nodes, dN, weights, q, dq, damping, C, prestress);
    const Graph graph = pattern(indptr, indices, w.n);
    require(data.size() == 9 * indices.size(), "data must be (nnz, 3, 3)");
    double* to = data.mutable_data();
    GilReleased release;
    const int V = vector_width();
    for_chunks({w.nodes, w.last, w.k}, graph, V, tangent_size(w, V), [&](const Chunk& chunk) {
        dispatch<double>([&](auto V) KL_INLINE_LAMBDA { add_tangent<V>(w, chunk, to); });
    });
}

}  // namespace

KL_MODULE(_lagrange, m) {
    define<&internal_load>(m, "internal_load", "∫ P grad N dV, (n, 3)",
                           {"points", "nodes", "dN", "weights", "q", "dq", "damping", "C", "prestress"});
    define<&totals>(m, "totals", "∫ (½ E:C:E + S0:E) dV and the largest |E|",
                    {"points", "nodes", "dN", "weights", "q", "C", "prestress"});
    define<&add_stiffness>(m, "add_stiffness", "Add the derivative of the load to the blocks of a matrix",
                           {"points", "nodes", "dN", "weights", "q", "dq", "damping", "C", "prestress", "indptr",
                            "indices", "data"});
}
