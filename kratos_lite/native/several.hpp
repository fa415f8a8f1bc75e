// Eight vectors of a level at once, so that a matrix is read once for all of them: (n, b, 8), the eight numbers
// of a component side by side.

#pragma once
#include <algorithm>

#include "isa.hpp"
#include "pattern.hpp"
#include "threads.hpp"

namespace kl {

constexpr int SEVERAL = 8;
typedef vec<float, SEVERAL> Several;

// d = alpha d + beta D^-1 r and next = from + d at a node, or d and next = beta D^-1 r without from.
template <int b>
KL_INLINE void change(const float* Dinv, const Several* r, const Several* from, Several* d, Several* next, float alpha,
                      float beta) {
    Several z[b] = {};
    for (int j = 0; j < b; ++j)
        for (int c = 0; c < b; ++c) z[c] += Dinv[j * b + c] * r[j];
    for (int c = 0; c < b; ++c) {
        d[c] = from ? alpha * d[c] + beta * z[c] : beta * z[c];
        next[c] = from ? from[c] + d[c] : d[c];
    }
}

// Row i of r = c - A x, of column-major blocks.
template <int b>
KL_INLINE void residual_row(const Graph& g, const float* A, const Several* c, const Several* x, int64_t i, Several* r) {
    Several sum[b];
    for (int e = 0; e < b; ++e) sum[e] = c[i * b + e];
    for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k) {
        const float* a = A + int64_t{k} * b * b;
        for (int j = 0; j < b; ++j) {
            const Several at = x[int64_t{g.indices[k]} * b + j];
            for (int e = 0; e < b; ++e) sum[e] -= a[j * b + e] * at;
        }
    }
    std::copy(sum, sum + b, r + i * b);
}

// Row i of P, or of its transpose, times x: blocks b x m, of which `places` says where they stand if they are not in
// their order; or one weight for three components.
template <int b, int m, bool transposed>
KL_INLINE void transfer_row(const int32_t* indptr, const int32_t* indices, const int32_t* places, const float* P,
                            bool weights, const Several* x, int64_t i, Several* out) {
    constexpr int to = transposed ? m : b, from = transposed ? b : m;
    Several sum[to] = {};
    for (int32_t k = indptr[i]; k < indptr[i + 1]; ++k) {
        const Several* at = x + int64_t{indices[k]} * from;
        const float* p = P + int64_t{transposed ? places[k] : k} * (weights ? 1 : b * m);
        for (int c = 0; c < to; ++c) {
            if (b == m && weights)
                sum[c] += *p * at[c];
            else
                for (int j = 0; j < from; ++j) sum[c] += p[transposed ? j * m + c : c * m + j] * at[j];
        }
    }
    std::copy(sum, sum + to, out);
}

// f(i) for all rows, in the instruction set of this machine.
template <class F>
void for_rows(int64_t rows, const F& f) {
    parallel_ranges(rows, 256, [&](int64_t first, int64_t last) {
        dispatch<float>([&](auto) KL_INLINE_LAMBDA {
            for (int64_t i = first; i < last; ++i) f(i);
        });
    });
}

}  // namespace kl
