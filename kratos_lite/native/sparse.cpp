// Products of the global matrix, 3x3 blocks of float64, with vectors.

#include "sparse.hpp"

#include "arrays.hpp"

namespace {

using namespace kl;

// Of one vector x (3n,), or of several (k, 3n).
Array<double> product(Indices indptr, Indices indices, Numbers data, Numbers x) {
    const int64_t rows = indptr.size() - 1, count = x.ndim() == 2 ? x.shape(0) : 1;
    const int64_t columns = x.ndim() == 2 ? x.shape(1) / 3 : x.size() / 3;
    const bool scalar = data.ndim() == 1;
    require(data.shape(0) == indices.size() && (scalar || (data.ndim() == 3 && data.size() == 9 * indices.size())),
            "data must be (nnz, 3, 3), or (nnz,)");
    require(columns >= rows && x.size() >= 3 * columns * count, "x must have three numbers for each row of blocks");
    Array<double> y = x.ndim() == 2 ? Array<double>({count, 3 * rows}) : Array<double>(3 * rows);
    const BlockMatrix A{pattern(indptr, indices, rows), data.data(), static_cast<uint32_t>(columns)};
    const double* from = x.data();
    double* to = y.mutable_data();
    GilReleased release;
    multiply(A, from, to, count, scalar);
    return y;
}

double largest_row_sum(Indices indptr, Numbers data) {
    const int64_t rows = indptr.size() - 1;
    check_rows(indptr, data.size() / 9);
    const BlockMatrix A{{rows, indptr.data(), nullptr}, data.data(), 0};
    GilReleased release;
    return norm(A);
}

}  // namespace

KL_MODULE(_sparse, m) {
    define<&largest_row_sum>(m, "norm", "largest row sum of |A|", {"indptr", "data"});
    define<&product>(m, "multiply", "A x of a matrix of 3x3 blocks, or of numbers for all three components", {"indptr", "indices", "data", "x"});
}
