// Products of the global matrix, 3x3 blocks of float64, with vectors.

#include "sparse.hpp"

#include "arrays.hpp"

namespace {

using kl::Array;
namespace py = pybind11;

Array<double> multiply(Array<int32_t> indptr, Array<int32_t> indices, Array<double> data, Array<double> x) {
    const int64_t rows = indptr.size() - 1;
    kl::require(data.ndim() == 3 && data.shape(0) == indices.size() && data.size() == 9 * indices.size(),
                "data must be (nnz, 3, 3)");
    kl::require(x.size() >= 3 * rows, "x must have three numbers for each row of blocks");
    Array<double> y(3 * rows);
    const kl::Blocks<double> A{rows, indptr.data(), indices.data(), data.data()};
    const double* from = x.data();
    double* to = y.mutable_data();
    py::gil_scoped_release release;
    kl::multiply(A, from, to);
    return y;
}

double norm(Array<int32_t> indptr, Array<double> data) {
    const int64_t rows = indptr.size() - 1;
    kl::require(rows < 1 || data.size() == 9 * static_cast<int64_t>(indptr.data()[rows]), "data must be (nnz, 3, 3)");
    const kl::Blocks<double> A{rows, indptr.data(), nullptr, data.data()};
    py::gil_scoped_release release;
    return kl::norm(A);
}

}  // namespace

PYBIND11_MODULE(_sparse, m) {
    kl::common(m);
    m.def("norm", &norm, "largest row sum of |A|", py::arg("indptr").noconvert(), py::arg("data").noconvert());
    m.def("multiply", &multiply, "A x of a matrix of 3x3 blocks", py::arg("indptr").noconvert(),
          py::arg("indices").noconvert(), py::arg("data").noconvert(), py::arg("x").noconvert());
}
