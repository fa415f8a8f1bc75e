// Matrices of dense blocks in rows of blocks (BSR): products with vectors.

#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "isa.hpp"
#include "threads.hpp"

namespace kl {

constexpr int64_t ROW_GRAIN = 1024;  // block rows of one task

// A matrix of R x C blocks, row-major blocks, as borrowed arrays.
template <class T, int R = 3, int C = 3>
struct Blocks {
    int64_t rows;
    const int32_t* indptr;
    const int32_t* indices;
    const T* data;
};

template <class T>
struct Product {
    Blocks<T> A;
    const T* x;
    T* y;
    int64_t first, last;
};

// y = A x for some rows of 3x3 blocks.  Four lanes hold the products of one column of a block, so
// that a row of blocks costs three multiply-adds each and one sum at its end.
template <int V, class T>
KL_INLINE void product_rows(const Product<T>& p) {
    typedef vec<T, 4> lane;
    for (int64_t i = p.first; i < p.last; ++i) {
        lane s0 = {}, s1 = {}, s2 = {};
        for (int32_t k = p.A.indptr[i]; k < p.A.indptr[i + 1]; ++k) {
            const T* a = p.A.data + 9 * static_cast<int64_t>(k);
            const T* x = p.x + 3 * static_cast<int64_t>(p.A.indices[k]);
            const lane v = {x[0], x[1], x[2], 0};
            const lane a2 = {a[6], a[7], a[8], 0};  // the fourth lane would lie beyond the block
            s0 += *reinterpret_cast<const lane*>(a) * v;
            s1 += *reinterpret_cast<const lane*>(a + 3) * v;
            s2 += a2 * v;
        }
        p.y[3 * i] = s0[0] + s0[1] + s0[2];
        p.y[3 * i + 1] = s1[0] + s1[1] + s1[2];
        p.y[3 * i + 2] = s2[0] + s2[1] + s2[2];
    }
}

template <int V>
KL_INLINE void product_f64(const Product<double>& p) { product_rows<V, double>(p); }
KL_DISPATCH(product_chunk, product_f64, double, const Product<double>&)

inline void multiply(const Blocks<double>& A, const double* x, double* y) {
    parallel_ranges(A.rows, ROW_GRAIN, [&](int64_t first, int64_t last) {
        product_chunk(Product<double>{A, x, y, first, last});
    });
}

// The largest sum of |A| over a row.
inline double norm(const Blocks<double>& A) {
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

}  // namespace kl
