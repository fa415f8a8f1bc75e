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

// Write rows of blocks, or of numbers for all three components, as rows of numbers; both may be at one place.
template <int wide>
void write_rows(const Graph& A, const double* data, int32_t* start, int32_t* column, double* number) {
    parallel_ranges(A.rows, ROW_GRAIN, [=](int64_t first, int64_t last) {
        std::vector<double> row;
        for (int64_t i = first; i < last; ++i) {
            const int64_t begin = A.indptr[i], count = A.indptr[i + 1] - begin;
            row.assign(data + wide * wide * begin, data + wide * wide * (begin + count));
            const int32_t* node = A.indices + begin;
            int64_t to = 3 * wide * begin;
            for (int axis = 0; axis < 3; ++axis, to += wide * count) {
                start[3 * i + axis] = static_cast<int32_t>(to);
                for (int64_t k = 0; k < count; ++k)
                    for (int b = 0; b < wide; ++b) {
                        column[to + wide * k + b] = 3 * node[k] + (wide == 3 ? b : axis);
                        number[to + wide * k + b] = row[wide == 3 ? 9 * k + 3 * axis + b : k];
                    }
            }
        }
    });
}

// The same matrix in rows of numbers, (indptr, indices, data); those of blocks are moved in place.
auto rows_of_numbers(Indices indptr, Indices indices, Array<double> data) {
    const int64_t rows = indptr.size() - 1, nnz = indices.size(), wide = data.ndim() == 1 ? 1 : 3;
    require(data.shape(0) == nnz && data.size() == wide * wide * nnz, "data must be (nnz, 3, 3), or (nnz,)");
    require(3 * wide * nnz <= INT32_MAX, "int32 cannot count the numbers");
    const Graph A = pattern(indptr, indices, rows);
    Array<int32_t> starts(3 * rows + 1), columns(3 * wide * nnz);
    Array<double> numbers = wide == 3 ? data : Array<double>(3 * nnz);
    int32_t *start = starts.mutable_data(), *column = columns.mutable_data();
    double* number = numbers.mutable_data();
    start[3 * rows] = static_cast<int32_t>(3 * wide * nnz);
    {
        GilReleased release;
        (wide == 3 ? write_rows<3> : write_rows<1>)(A, data.data(), start, column, number);
    }
    return std::make_tuple(starts, columns, numbers);
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
    define<&rows_of_numbers>(m, "rows_of_numbers", "the same matrix in rows of numbers: indptr, indices, data", {"indptr", "indices", "data"});
    define<&product>(m, "multiply", "A x of a matrix of 3x3 blocks, or of numbers for all three components", {"indptr", "indices", "data", "x"});
}
