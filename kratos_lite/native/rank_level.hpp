// One level of a multigrid over ranks: the rows of own nodes, and what makes the next level of them.
//
// Nodes are own ones, 0 … n - 1, and then copies of those of others.  Vectors belong to the caller, who fills in the
// copies; they have room for eight numbers behind their last.

#pragma once
#include "transfer.hpp"

namespace kl {

class RankLevel {
public:
    // Blocks of own rows, with columns among all nodes; `fixed` has a byte for each component of all nodes.
    RankLevel(const Graph& g, const double* data, int block, Bytes fixed_components)
        : fixed(std::move(fixed_components)), blocks(data) {
        inverse = level.set_matrix(g, data, fixed, block);
        forget_vectors();
    }

    // The product of elements in place of a matrix; the first `own` of its nodes are own ones.
    RankLevel(const MatrixFree& product, int64_t own, Bytes fixed_components) : fixed(std::move(fixed_components)) {
        inverse = level.set_elements(product, fixed);
        level.n = own;
        forget_vectors();
    }

    int b() const { return level.b; }
    int64_t n() const { return level.n; }
    int64_t all() const { return static_cast<int64_t>(fixed.size()) / level.b; }
    int64_t room() const { return static_cast<int64_t>(fixed.size()) + 8; }
    int64_t bytes() const { return level.bytes() + static_cast<int64_t>(fixed.size()); }

    // to = x + d with d = alpha d + beta D^-1 (c - A x); or, without beta, to = c - A x.
    void step(const float* x, const float* c, float* d, float* to, float alpha, float beta) const {
        if (level.elements) return level.step_elements(x, c, d, to, alpha, beta, beta != 0);
        const float* D = beta != 0 ? level.Dinv.data() : nullptr;
        parallel_ranges(n(), level.grain(), [&](int64_t first, int64_t last) {
            dispatch<float>([&](auto) KL_INLINE_LAMBDA {
                if (b() == 3)
                    step_rows<3, float>(level.graph, level.A.data(), D, c, x, d, to, alpha, beta, first, last);
                else
                    step_rows<6, float>(level.graph, level.A.data(), D, c, x, d, to, alpha, beta, first, last);
            });
        });
    }

    // x = d = beta D^-1 c
    void first_step(const float* c, float* d, float* x, float beta) const { level.first_step(c, d, x, beta); }

    // The aggregate of each own node among them, -1 for fixed ones; links to copies do not join.
    int32_t aggregates(double theta, Ints& of) const {
        const int size = level.b * level.b;
        const Doubles norms = diagonal_norms(level.graph, blocks, size);
        Ints indptr(n() + 1, 0), indices;
        Bytes strong, excluded(n());
        for (int64_t i = 0; i < n(); ++i) {
            excluded[i] = 1;
            for (int c = 0; c < level.b; ++c) excluded[i] &= fixed[i * level.b + c];
            for (int32_t k = level.graph.indptr[i]; k < level.graph.indptr[i + 1]; ++k) {
                const int32_t j = level.graph.indices[k];
                if (j >= n()) continue;
                const double norm = std::sqrt(squared_norm(blocks + int64_t{k} * size, size));
                indices.push_back(j);
                strong.push_back(j == i || norm >= theta * std::sqrt(norms[i] * norms[j]));
            }
            indptr[i + 1] = static_cast<int32_t>(indices.size());
        }
        return aggregate({n(), indptr.data(), indices.data()}, excluded, strong, of);
    }

    // Rows of own nodes of the smoothed prolongator: `of` and T (all nodes, b, 6) say which coarse node each node
    // belongs to, and how.
    Prolongator prolongator(const Ints& of, const Doubles& T, double omega) const {
        const Smoothing smoothing{level.graph, blocks, fixed, of, T, 1, omega};
        return b() == 3 ? smoothed_prolongator<3>(smoothing, inverse.data())
                        : smoothed_prolongator<6>(smoothing, inverse.data());
    }

    // What own rows give to P^T A P, with rows of P for all nodes, and coarse nodes among `count`.
    CoarseMatrix galerkin(const Prolongator& P, int32_t count) const {
        const Ints starts(P.indptr.begin(), P.indptr.begin() + n() + 1);
        const Ints indices(P.indices.begin(), P.indices.begin() + starts.back());
        const Transposed columns(count, starts, indices);
        return b() == 3 ? kl::galerkin_sum<3>(level.graph, blocks, P, columns, count)
                        : kl::galerkin_sum<6>(level.graph, blocks, P, columns, count);
    }

    // Let go of what only the next level is made of.
    void forget() {
        inverse = {};
        blocks = nullptr;
    }

    bool is_whole() const { return blocks != nullptr; }

private:
    void forget_vectors() {
        for (Floats* v : {&level.x, &level.y, &level.d, &level.c}) *v = {};
    }

    Bytes fixed;
    Level level;
    const double* blocks = nullptr;
    Doubles inverse;
};

}  // namespace kl
