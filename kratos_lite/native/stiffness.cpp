// The sparsity pattern of a mesh and its stiffness matrix.

#include "stiffness.hpp"

#include <pybind11/stl.h>

#include <memory>

#include "arrays.hpp"
#include "pattern.hpp"

namespace {

using kl::Array;
using kl::require;
namespace py = pybind11;

kl::Connectivity connectivity(const Array<int32_t>& nodes) {
    require(nodes.ndim() == 2, "nodes must be (m, k)");
    return {nodes.data(), nodes.shape(0), static_cast<int>(nodes.shape(1))};
}

py::tuple pattern(int64_t n_nodes, const std::vector<Array<int32_t>>& arrays) {
    std::vector<kl::Connectivity> groups;
    for (const auto& nodes : arrays) groups.push_back(connectivity(nodes));
    std::unique_ptr<kl::Pattern> rows;
    int64_t size;
    {
        py::gil_scoped_release release;
        rows = std::make_unique<kl::Pattern>(n_nodes, groups);
        size = rows->size();
    }
    if (size > INT32_MAX) throw std::overflow_error("the matrix has more than 2^31 blocks");
    Array<int32_t> indptr(n_nodes + 1), indices(size);
    int32_t *starts = indptr.mutable_data(), *columns = indices.mutable_data();
    {
        py::gil_scoped_release release;
        rows->copy(starts, columns);
        rows.reset();
    }
    return py::make_tuple(indptr, indices);
}

kl::Tables tables(const Array<double>& dN, const Array<double>& weights, bool affine) {
    require(dN.ndim() == 3 && dN.shape(2) == 3 && dN.shape(0) == weights.size(), "dN must be (g, k, 3)");
    kl::Tables t{dN.data(), weights.data(), static_cast<int>(dN.shape(0)), static_cast<int>(dN.shape(1)), {}};
    if (!affine || !t.affine_pays()) return t;
    for (int a = 0; a < t.k; ++a)
        for (int b = a; b < t.k; ++b)
            for (int ij = 0; ij < 9; ++ij) {
                double sum = 0;
                for (int q = 0; q < t.g; ++q)
                    sum += t.weights[q] * t.dN[3 * (q * t.k + a) + ij / 3] * t.dN[3 * (q * t.k + b) + ij % 3];
                t.products.push_back(sum);
            }
    return t;
}

// Two numbers are Lamé's constants; a (6, 6) matrix in the order xx yy zz xy yz zx becomes C[ik][jl].
kl::Moduli moduli(const Array<double>& C) {
    kl::Moduli m{C.size() == 2, 0, 0, {}};
    if (m.isotropic) {
        m.lambda = C.data()[0];
        m.mu = C.data()[1];
        return m;
    }
    require(kl::has_shape(C, 6, 6), "C must be (6, 6), or lambda and mu");
    const int voigt[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            for (int k = 0; k < 3; ++k)
                for (int l = 0; l < 3; ++l) m.tensor[3 * i + j][3 * k + l] = C.at(voigt[i][k], voigt[j][l]);
    return m;
}

int64_t add_stiffness(Array<double> points, Array<int32_t> nodes, Array<double> dN, Array<double> weights,
                      Array<double> C, Array<int32_t> indptr, Array<int32_t> indices, Array<double> data,
                      bool affine) {
    const int64_t rows = indptr.size() - 1;
    const auto mesh = connectivity(nodes);
    const auto t = tables(dN, weights, affine);
    const auto m = moduli(C);
    require(points.ndim() == 2 && points.shape(1) == 3 && points.shape(0) == rows, "points must be (n, 3)");
    require(mesh.k == t.k, "nodes and dN must have the same number of nodes");
    require(data.size() == 9 * indices.size(), "data must be (nnz, 3, 3)");
    require(kl::are_rows(nodes, rows), "nodes must be rows of the matrix");
    const kl::Graph graph{rows, indptr.data(), indices.data()};
    const double* from = points.data();
    double* to = data.mutable_data();
    py::gil_scoped_release release;
    return kl::add_stiffness(t, m, mesh, from, graph, to);
}

void add_matrices(Array<int32_t> nodes, Array<double> matrices, Array<int32_t> indptr, Array<int32_t> indices,
                  Array<double> data) {
    const auto mesh = connectivity(nodes);
    const kl::Graph graph{indptr.size() - 1, indptr.data(), indices.data()};
    const int64_t each = data.ndim() == 3 ? 9 : 1;
    require(data.size() == each * indices.size(), "data must be (nnz, 3, 3) or (nnz,)");
    require(matrices.size() == each * mesh.count * mesh.k * mesh.k,
            "matrices must be (m, k, k, 3, 3) or (m, k, k)");
    require(kl::are_rows(nodes, graph.rows), "nodes must be rows of the matrix");
    const double* from = matrices.data();
    double* to = data.mutable_data();
    py::gil_scoped_release release;
    each == 9 ? kl::add_matrices<3>(mesh, from, graph, to) : kl::add_matrices<1>(mesh, from, graph, to);
}

}  // namespace

PYBIND11_MODULE(_stiffness, m) {
    kl::common(m);
    m.def("pattern", &pattern, "Rows (indptr, indices) of the nodes that share an element",
          py::arg("n_nodes"), py::arg("connectivity"));
    m.def("add_stiffness", &add_stiffness, "Add the stiffness of elements to the blocks of a matrix",
          py::arg("points").noconvert(), py::arg("nodes").noconvert(), py::arg("dN").noconvert(),
          py::arg("weights").noconvert(), py::arg("C").noconvert(), py::arg("indptr").noconvert(),
          py::arg("indices").noconvert(), py::arg("data").noconvert(), py::arg("affine") = true);
    m.def("add_matrices", &add_matrices, "Add given element matrices to a matrix",
          py::arg("nodes").noconvert(), py::arg("matrices").noconvert(), py::arg("indptr").noconvert(),
          py::arg("indices").noconvert(), py::arg("data").noconvert());
}
