// Matrices of dense 3x3 blocks in rows of blocks (BSR): products with vectors; sums over vectors.

#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "isa.hpp"
#include "pattern.hpp"
#include "threads.hpp"

namespace kl {

constexpr int64_t ROW_GRAIN = 1024;      // block rows of one task
constexpr int64_t VECTOR_GRAIN = 16384;  // numbers of one task on a vector

// A matrix of row-major blocks, as borrowed arrays.
struct BlockMatrix : Graph {
    const double* data;
    uint32_t columns;
};

// y = A x of `count` vectors for some rows of blocks; false at an index that is no column.  Four lanes hold the
// products of one column of a block, so that a row of blocks costs three multiply-adds each and one sum at its end.
template <int count>
KL_INLINE bool multiply_rows(const BlockMatrix& A, const double* from, double* y, int64_t first, int64_t last) {
    typedef vec<double, 4> Vec;
    const int64_t in = 3 * int64_t{A.columns}, out = 3 * A.rows;
    for (int64_t i = first; i < last; ++i) {
        Vec s[count][3] = {};
        for (int32_t k = A.indptr[i]; k < A.indptr[i + 1]; ++k) {
            const double* a = A.data + 9 * static_cast<int64_t>(k);
            const uint32_t j = static_cast<uint32_t>(A.indices[k]);
            if (j >= A.columns) return false;
            const Vec a2 = {a[6], a[7], a[8], 0};  // the fourth lane would lie beyond the block
            for (int v = 0; v < count; ++v) {
                const double* x = from + v * in + 3 * static_cast<int64_t>(j);
                const Vec at = {x[0], x[1], x[2], 0};
                s[v][0] += *reinterpret_cast<const Vec*>(a) * at;
                s[v][1] += *reinterpret_cast<const Vec*>(a + 3) * at;
                s[v][2] += a2 * at;
            }
        }
        for (int v = 0; v < count; ++v)
            for (int c = 0; c < 3; ++c) y[v * out + 3 * i + c] = s[v][c][0] + s[v][c][1] + s[v][c][2];
    }
    return true;
}

// The same of a matrix with one number for all three components.
template <int count>
KL_INLINE bool multiply_scalar_rows(const BlockMatrix& A, const double* from, double* y, int64_t first, int64_t last) {
    typedef vec<double, 4> Vec;
    const int64_t in = 3 * int64_t{A.columns}, out = 3 * A.rows;
    for (int64_t i = first; i < last; ++i) {
        Vec s[count] = {};
        for (int32_t k = A.indptr[i]; k < A.indptr[i + 1]; ++k) {
            const uint32_t j = static_cast<uint32_t>(A.indices[k]);
            if (j >= A.columns) return false;
            const bool inside = j + 1 < A.columns;  // there, the fourth lane does not lie beyond the vector
            for (int v = 0; v < count; ++v) {
                const double* x = from + v * in + 3 * static_cast<int64_t>(j);
                s[v] += A.data[k] * (inside ? *reinterpret_cast<const Vec*>(x) : Vec{x[0], x[1], x[2], 0});
            }
        }
        for (int v = 0; v < count; ++v)
            for (int c = 0; c < 3; ++c) y[v * out + 3 * i + c] = s[v][c];
    }
    return true;
}

// y = A x of one vector, or of `count` ones, each behind the other; four read the matrix once.
inline void multiply(const BlockMatrix& A, const double* x, double* y, int64_t count = 1, bool scalar = false) {
    constexpr int TOGETHER = 4;
    while (count > 0) {
        const bool many = count >= TOGETHER;
        parallel_ranges(A.rows, ROW_GRAIN, [&](int64_t first, int64_t last) {
            dispatch<double>([=](auto) KL_INLINE_LAMBDA {
                const bool fits = scalar ? many ? multiply_scalar_rows<TOGETHER>(A, x, y, first, last)
                                                : multiply_scalar_rows<1>(A, x, y, first, last)
                                  : many ? multiply_rows<TOGETHER>(A, x, y, first, last)
                                         : multiply_rows<1>(A, x, y, first, last);
                if (!fits) throw std::invalid_argument("an index is no column of the matrix");
            });
        });
        const int done = many ? TOGETHER : 1;
        count -= done;
        x += done * 3 * int64_t{A.columns};
        y += done * 3 * A.rows;
    }
}

// The largest sum of |A| over a row.
inline double norm(const BlockMatrix& A) {
    std::vector<double> largest((A.rows + ROW_GRAIN - 1) / ROW_GRAIN, 0.0);
    parallel_ranges(A.rows, ROW_GRAIN, [&](int64_t first, int64_t last) {
        double& mine = largest[first / ROW_GRAIN];
        for (int64_t i = first; i < last; ++i) {
            double sum[3] = {};
            for (int64_t k = A.indptr[i]; k < A.indptr[i + 1]; ++k)
                for (int e = 0; e < 9; ++e) sum[e / 3] += std::fabs(A.data[9 * k + e]);
            mine = std::max({mine, sum[0], sum[1], sum[2]});
        }
    });
    return largest.empty() ? 0.0 : *std::max_element(largest.begin(), largest.end());
}

// f(i) for all numbers of a vector.
template <class F>
void for_each(int64_t n, const F& f) {
    parallel_ranges(n, VECTOR_GRAIN, [&](int64_t first, int64_t last) {
        for (int64_t i = first; i < last; ++i) f(i);
    });
}

// Sums of the `count` numbers that f(i, sums) adds for all numbers of a vector, the same for any number of threads.
template <int count, class F>
std::array<double, count> sums(int64_t n, const F& f) {
    constexpr int64_t PART = 8192;
    std::vector<std::array<double, count>> parts((n + PART - 1) / PART);
    parallel_ranges(n, PART, [&](int64_t first, int64_t last) {
        std::array<double, count> sum = {};
        for (int64_t i = first; i < last; ++i) f(i, sum);
        parts[first / PART] = sum;
    });
    std::array<double, count> total = {};
    for (const auto& part : parts)
        for (int c = 0; c < count; ++c) total[c] += part[c];
    return total;
}

// The sum of x y in double.
template <class T>
double dot(const T* x, const T* y, int64_t n) {
    return sums<1>(n, [&](int64_t i, auto& sum) { sum[0] += static_cast<double>(x[i]) * y[i]; })[0];
}

}  // namespace kl
