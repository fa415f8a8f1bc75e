// Transfers between the levels of a multigrid hierarchy.

#pragma once
#include "cluster_transfer.hpp"
#include "level.hpp"

namespace kl {

typedef vec<float, 8> Modes;  // six modes; the last two lanes hold what is not used

// Coarse rows of to = P^T from.
template <int b>
KL_INLINE void restrict_rows(const Transposed& columns, const float* P, const float* from, float* to,
                             int64_t first, int64_t last) {
    for (int64_t I = first; I < last; ++I) {
        Modes even = {}, odd = {};
        for (int32_t k = columns.indptr[I]; k < columns.indptr[I + 1]; ++k) {
            const float* r = from + static_cast<int64_t>(columns.rows[k]) * b;
            const float* p = P + static_cast<int64_t>(columns.entries[k]) * b * MODES;
            for (int j = 0; j < b; ++j)
                (j % 2 ? odd : even) += *reinterpret_cast<const Modes*>(p + j * MODES) * r[j];
        }
        const Modes sum = even + odd;
        for (int c = 0; c < MODES; ++c) to[I * MODES + c] = sum[c];
    }
}

// Fine rows of to += P from.
template <int b>
KL_INLINE void prolong_rows(const Prolongator& P, const float* from, float* to, int64_t first, int64_t last) {
    for (int64_t i = first; i < last; ++i) {
        Modes sum[b] = {};
        for (int32_t k = P.indptr[i]; k < P.indptr[i + 1]; ++k) {
            const Modes x = *reinterpret_cast<const Modes*>(from + static_cast<int64_t>(P.indices[k]) * MODES);
            const float* p = &P.data[static_cast<int64_t>(k) * b * MODES];
            for (int j = 0; j < b; ++j) sum[j] += *reinterpret_cast<const Modes*>(p + j * MODES) * x;
        }
        for (int j = 0; j < b; ++j) {
            const Modes s = sum[j];
            to[i * b + j] += (s[0] + s[1]) + (s[2] + s[3]) + (s[4] + s[5]);
        }
    }
}

// Let nodes that depend on others join the aggregate of the one that they depend on most.
inline void join_dependents(const Ties& ties, Ints& of) {
    for (int32_t t = 0; t < ties.size(); ++t) {
        int32_t& own = of[ties.dependents[t] / 3];
        double most = 0;
        for (int32_t k = ties.start[t]; k < ties.start[t + 1] && (own < 0 || most > 0); ++k)
            if (const double w = std::fabs(ties.weights[k]); w > most && of[ties.independents[k] / 3] >= 0) {
                own = of[ties.independents[k] / 3];
                most = w;
            }
    }
}

// P with the rows of components that depend on others in place of their own.
inline Prolongator with_dependents(const Prolongator& P, const Ties& ties, int64_t coarse_nodes) {
    constexpr int size = 3 * MODES;
    const int64_t n = static_cast<int64_t>(P.indptr.size()) - 1;
    Ints first(n + 1, 0), tied(n, 0);
    for (int32_t t = 0; t < ties.size(); ++t) {
        ++first[ties.dependents[t] / 3 + 1];
        tied[ties.dependents[t] / 3] += ties.width[t];
    }
    std::partial_sum(first.begin(), first.end(), first.begin());
    Prolongator Q;
    UnionRows(n, coarse_nodes, [&](int64_t i, const auto& add) {
        const auto row = [&](int64_t j) { std::for_each(&P.indices[P.indptr[j]], &P.indices[P.indptr[j + 1]], add); };
        if (tied[i] < 3) row(i);
        for (int32_t k = ties.start[first[i]]; k < ties.start[first[i + 1]]; ++k) row(ties.independents[k] / 3);
    }).copy_to(Q.indptr, Q.indices);
    Q.data.assign(Q.indices.size() * size + 8, 0.0f);
    parallel_ranges(n, ROW_GRAIN, [&](int64_t begin, int64_t end) {
        for (int64_t i = begin; i < end; ++i) {
            // count numbers from `to` += w times those from `from`, in all columns of row j of P
            const auto add = [&](int64_t j, float w, int to, int from, int count) {
                const int32_t* at = &Q.indices[Q.indptr[i]];
                for (int32_t q = P.indptr[j]; q < P.indptr[j + 1]; ++q) {
                    while (*at < P.indices[q]) ++at;
                    float* row = &Q.data[(at - Q.indices.data()) * size];
                    for (int e = 0; e < count; ++e) row[to + e] += w * P.data[int64_t{q} * size + from + e];
                }
            };
            if (tied[i] < 3) add(i, 1, 0, 0, size);
            for (int32_t t = first[i]; t < first[i + 1]; ++t)
                for (int32_t k = ties.start[t]; k < ties.start[t + 1]; ++k)
                    add(ties.independents[k] / 3, static_cast<float>(ties.weights[k]),
                        ties.dependents[t] % 3 * MODES, ties.independents[k] % 3 * MODES, ties.width[t] * MODES);
        }
    });
    return Q;
}

// From a level to the next coarser one: blocks b x 6 of smoothed aggregation, or one weight or 3 x 3 of them for
// each pair of nodes (linear elements within quadratic ones).
struct Transfer {
    Prolongator P;
    Transposed columns;
    int weights = 0;  // of a pair: 1, 9, or 0 for blocks
    Bytes fine_fixed, coarse_fixed;  // components that weights must not touch

    Transfer(Prolongator prolongator, int64_t coarse_nodes)
        : P(std::move(prolongator)), columns(coarse_nodes, P.indptr, P.indices) {}
    Transfer(Prolongator prolongator, int weights, Bytes fine_fixed, Bytes coarse_fixed)
        : P(std::move(prolongator)), columns(static_cast<int64_t>(coarse_fixed.size()) / 3, P.indptr, P.indices),
          weights(weights), fine_fixed(std::move(fine_fixed)), coarse_fixed(std::move(coarse_fixed)) {}

    int64_t bytes() const {
        return 4 * static_cast<int64_t>(P.indptr.size() + P.indices.size() + P.data.size() + columns.indptr.size() +
                                        columns.rows.size() + columns.entries.size());
    }

    // Component c of the weights of pair k, or of their transpose, times x.
    template <int row, int column>
    KL_INLINE float along(int32_t k, int c, const float* x) const {
        if (weights == 1) return P.data[k] * x[c];
        const float* p = &P.data[9 * static_cast<int64_t>(k) + row * c];
        return p[0] * x[0] + p[column] * x[1] + p[2 * column] * x[2];
    }

    // c of the coarse level = P^T y of the fine one
    void restrict_to(Level& fine, Level& coarse) const {
        if (coarse.vectors > 1) return restrict_several(fine, coarse);
        const float* from = fine.y.data();
        float* to = coarse.c.data();
        parallel_ranges(static_cast<int64_t>(columns.indptr.size()) - 1, 64, [&](int64_t first, int64_t last) {
            if (!weights)
                return with_size(fine.b, [&](auto B) {
                    constexpr int b = decltype(B)::value;
                    dispatch<float>([&](auto) KL_INLINE_LAMBDA {
                        restrict_rows<b>(columns, P.data.data(), from, to, first, last);
                    });
                });
            for (int64_t I = first; I < last; ++I) {
                float sum[3] = {};
                for (int32_t k = columns.indptr[I]; k < columns.indptr[I + 1]; ++k)
                    for (int c = 0; c < 3; ++c)
                        sum[c] += along<1, 3>(columns.entries[k], c, from + 3 * static_cast<int64_t>(columns.rows[k]));
                for (int c = 0; c < 3; ++c) to[3 * I + c] = coarse_fixed[3 * I + c] ? 0.0f : sum[c];
            }
        });
        coarse.halo->add(to);
    }

    // x of the fine level += P x of the coarse one
    void prolong(Level& coarse, Level& fine) const {
        coarse.halo->update(coarse.x.data());
        if (coarse.vectors > 1) return prolong_several(coarse, fine);
        const float* from = coarse.x.data();
        float* to = fine.x.data();
        parallel_ranges(fine.n, 1024, [&](int64_t first, int64_t last) {
            if (!weights)
                return with_size(fine.b, [&](auto B) {
                    constexpr int b = decltype(B)::value;
                    dispatch<float>([&](auto) KL_INLINE_LAMBDA { prolong_rows<b>(P, from, to, first, last); });
                });
            for (int64_t i = first; i < last; ++i) {
                float sum[3] = {};
                for (int32_t k = P.indptr[i]; k < P.indptr[i + 1]; ++k)
                    for (int c = 0; c < 3; ++c)
                        sum[c] += along<3, 1>(k, c, from + 3 * static_cast<int64_t>(P.indices[k]));
                for (int c = 0; c < 3; ++c)
                    if (!fine_fixed[3 * i + c]) to[3 * i + c] += sum[c];
            }
        });
    }

private:
    // f(b, m) with the size of the blocks; weights count as blocks 3 x 3.
    template <class F>
    void with_blocks(const Level& fine, const F& f) const {
        if (weights) return f(std::integral_constant<int, 3>(), std::integral_constant<int, 3>());
        with_size(fine.b, [&](auto b) { f(b, std::integral_constant<int, MODES>()); });
    }

    void restrict_several(Level& fine, Level& coarse) const {
        with_blocks(fine, [&](auto B, auto M) {
            for_rows(coarse.n, [&](int64_t i) KL_INLINE_LAMBDA {
                constexpr int m = decltype(M)::value;
                Several* to = Level::of(coarse.c) + i * m;
                transfer_row<decltype(B)::value, m, true>(columns.indptr.data(), columns.rows.data(),
                                                          columns.entries.data(), P.data.data(), weights == 1,
                                                          Level::of(fine.y), i, to);
                for (int c = 0; weights && c < m; ++c)
                    if (coarse_fixed[3 * i + c]) to[c] = Several{};
            });
        });
    }

    void prolong_several(Level& coarse, Level& fine) const {
        with_blocks(fine, [&](auto B, auto M) {
            for_rows(fine.n, [&](int64_t i) KL_INLINE_LAMBDA {
                constexpr int b = decltype(B)::value;
                Several sum[b], *to = Level::of(fine.x) + i * b;
                transfer_row<b, decltype(M)::value, false>(P.indptr.data(), P.indices.data(), nullptr, P.data.data(),
                                                           weights == 1, Level::of(coarse.x), i, sum);
                for (int c = 0; c < b; ++c)
                    if (!weights || !fine_fixed[3 * i + c]) to[c] += sum[c];
            });
        });
    }
};

}  // namespace kl
