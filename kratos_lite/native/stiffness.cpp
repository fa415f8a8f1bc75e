// The sparsity pattern of a mesh and its stiffness matrix.

#include "stiffness.hpp"

#include <memory>

#include "elements.hpp"

namespace {

using namespace kl;

Connectivity connectivity(Indices nodes) {
    require(nodes.ndim() == 2, "nodes must be (m, k)");
    return {nodes.data(), nodes.shape(0), static_cast<int>(nodes.shape(1))};
}

auto mesh_pattern(int64_t n_nodes, const std::vector<Array<int32_t>>& arrays) {
    std::vector<Connectivity> groups;
    for (const auto& nodes : arrays) groups.push_back(connectivity(nodes));
    std::unique_ptr<UnionRows> rows;
    int64_t size;
    {
        GilReleased release;
        rows = std::make_unique<UnionRows>(neighbors(n_nodes, groups));
        size = rows->size();
    }
    if (size > INT32_MAX) throw std::overflow_error("the matrix has more than 2^31 blocks");
    Array<int32_t> indptr(n_nodes + 1), indices(size);
    int32_t *starts = indptr.mutable_data(), *columns = indices.mutable_data();
    {
        GilReleased release;
        rows->copy_to(starts, columns);
        rows.reset();
    }
    return std::make_tuple(indptr, indices);
}

// Products of the reference cell, R_ab for a <= b.
std::vector<double> products(const Stiffness& w) {
    std::vector<double> found;
    for (int a = 0; a < w.k; ++a)
        for (int b = a; b < w.k; ++b)
            for (int ij = 0; ij < 9; ++ij) {
                double sum = 0;
                for (int q = 0; q < w.g; ++q)
                    sum += w.weights[q] * w.dN_at(q)[3 * a + ij / 3] * w.dN_at(q)[3 * b + ij % 3];
                found.push_back(sum);
            }
    return found;
}

// C in the order xx yy zz xy yz zx, as C[ik][jl].  With c = share C m / 3, m = (1, 1, 1, 0, 0, 0), and
// k = share m c / 3 a dilatation that is projected leaves C - c m^T - m c^T + k m m^T at the Gauss points.
Moduli moduli(const Law& law, double share) {
    double C[6][6], c[6], k = 0;
    for (int i = 0; i < 6; ++i) c[i] = share * (law.C[6 * i] + law.C[6 * i + 1] + law.C[6 * i + 2]) / 3;
    for (int i = 0; i < 3; ++i) k += share * c[i] / 3;
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j)
            C[i][j] = law.C[6 * i + j] - (j < 3) * c[i] - (i < 3) * c[j] + (i < 3 && j < 3) * k;
    Moduli m{law.isotropic, C[0][1], C[3][3], {}, {}};
    const int voigt[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) m.coupling[i][j] = c[voigt[i][j]] - (i == j) * k / 2;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            for (int n = 0; n < 3; ++n)
                for (int l = 0; l < 3; ++l) m.tensor[3 * i + j][3 * n + l] = C[voigt[i][n]][voigt[j][l]];
    return m;
}

int64_t add(Numbers points, Indices nodes, Numbers dN, Numbers weights, Numbers C, const MaybeTables& addition,
            Indices indptr, Indices indices, Array<double> data, bool affine, MaybeNumbers factors) {
    Stiffness w{elements(points, nodes, dN, weights), {}, {}, data.mutable_data(), nullptr};
    w.factors = optional(factors, w.last, 1, "factors must be (m, 1)");
    set_law(w, C, addition);
    w.moduli = moduli(w.law, w.addition.share);
    const Graph graph = pattern(indptr, indices, w.n);
    require(data.size() == 9 * indices.size(), "data must be (nnz, 3, 3)");
    if (affine && w.affine_pays()) w.products = products(w);
    GilReleased release;
    switch (w.addition.kind) {
        case Addition::modes: return add_stiffness<ModesAdded>(w, graph);
        case Addition::dilatation: return add_stiffness<DilatationAdded>(w, graph);
        default: return add_stiffness<NothingAdded>(w, graph);
    }
}

void add_given(Indices nodes, Numbers matrices, Indices indptr, Indices indices, Array<double> data) {
    const Connectivity mesh = connectivity(nodes);
    const Graph graph = pattern(indptr, indices, indptr.size() - 1);
    const int64_t each = data.ndim() == 3 ? 9 : 1;
    require(data.size() == each * indices.size(), "data must be (nnz, 3, 3) or (nnz,)");
    require(matrices.size() == each * mesh.count * mesh.k * mesh.k,
            "matrices must be (m, k, k, 3, 3) or (m, k, k)");
    require(are_rows(nodes, graph.rows), "nodes must be rows of the matrix");
    const double* from = matrices.data();
    double* to = data.mutable_data();
    GilReleased release;
    each == 9 ? add_matrices<3>(mesh, from, graph, to) : add_matrices<1>(mesh, from, graph, to);
}

}  // namespace

KL_MODULE(_stiffness, m) {
    define<&mesh_pattern>(m, "pattern", "Rows (indptr, indices) of the nodes that share an element",
                          {"n_nodes", "connectivity"});
    define<&add>(m, "add_stiffness", "Add the stiffness of elements to the blocks of a matrix",
                 {"points", "nodes", "dN", "weights", "C", "addition", "indptr", "indices", "data",
                  {"affine", Py_True}, {"factors", Py_None}});
    define<&add_given>(m, "add_matrices", "Add given element matrices to a matrix",
                       {"nodes", "matrices", "indptr", "indices", "data"});
}
