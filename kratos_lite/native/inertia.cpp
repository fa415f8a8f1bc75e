// Matrices of mass at rest or in flow, M, G and H, for elements of any shape.
//
// Arguments: elements and tables as in elements.hpp with weights times ρ, the velocity c = A X + b as (3, 4),
// the pattern, and data (nnz,) of each matrix or None.  Sums run over the elements in their order, whatever
// the number of threads.

#include "inertia.hpp"

#include "elements.hpp"

namespace {

using namespace kl;
using Data = std::optional<Array<double>>;

double* optional(Data& array, Indices indices) {
    require(!array || array->size() == indices.size(), "data must be float (nnz,)");
    return array ? array->mutable_data() : nullptr;
}

void add(Numbers points, Indices nodes, Numbers N, Numbers dN, Numbers weights, Numbers velocity,
         Indices indptr, Indices indices, Data M, Data G, Data H) {
    Inertia w{elements(points, nodes, N, dN, weights), velocity.data(), optional(M, indices),
              optional(G, indices), optional(H, indices), {}};
    require(has_shape(velocity, 3, 4), "velocity must be (3, 4)");
    const Graph graph = pattern(indptr, indices, w.n);
    w.N_padded.assign(static_cast<int64_t>(w.g) * w.padded_k(), 0.0);
    for (int q = 0; q < w.g; ++q) std::copy_n(w.N + q * w.k, w.k, w.N_padded.data() + q * w.padded_k());
    GilReleased release;
    const int V = vector_width();
    for_chunks({w.nodes, w.last, w.k}, graph, V, w.size(V), [&](const Chunk& chunk) {
        dispatch<double>([&](auto V) KL_INLINE_LAMBDA { add_inertia<V>(w, chunk); });
    });
}

}  // namespace

KL_MODULE(_inertia, m) {
    define<&add>(m, "add", "Add M, G and H of elements to the data of matrices, of those that are given",
                 {"points", "nodes", "N", "dN", "weights", "velocity", "indptr", "indices",
                  {"M", Py_None}, {"G", Py_None}, {"H", Py_None}});
}
