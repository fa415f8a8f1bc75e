// Conjugate gradients preconditioned by a multigrid hierarchy.

#pragma once
#include "hierarchy.hpp"

namespace kl {

struct Outcome {
    int iterations;
    bool converged;
};

constexpr int STALLED = 200;  // iterations without a new smallest residual; thin elements make plateaus

// Conjugate gradients on A x = b with the V-cycle; A's rows at fixed components are left out.
// Source: Saad, Iterative Methods for Sparse Linear Systems (2003), algorithm 9.1.
template <class Product, class Each>
Outcome conjugate_gradients(const Product& times_A, const Bytes& fixed, Hierarchy& M, const double* b, double* x,
                            double tolerance, double norm_A, int most, const Each& each) {
    const int64_t n = static_cast<int64_t>(fixed.size());
    Doubles r(b, b + n), z(n + 1), p, Ap(n);  // products without a matrix read a number behind the last
    std::fill(x, x + n, 0.0);
    const double norm_b = std::sqrt(dot(b, b, n));
    if (norm_b == 0) return {0, true};
    M.cycle(r.data(), z.data());
    p = z;
    double rz = dot(r.data(), z.data(), n), best = INFINITY;  // residuals may grow at first
    int best_at = 0;
    for (int k = 1; k <= most; ++k) {
        times_A(p.data(), Ap.data());
        const double curvature = sums<1>(n, [&](int64_t i, auto& sum) {
            if (fixed[i]) Ap[i] = 0;
            sum[0] += p[i] * Ap[i];
        })[0];
        if (!(curvature > 0 && rz > 0)) return {k, false};
        const double alpha = rz / curvature;
        const auto [rr, xx] = sums<2>(n, [&](int64_t i, auto& sum) {
            x[i] += alpha * p[i];
            r[i] -= alpha * Ap[i];
            sum[0] += r[i] * r[i];
            sum[1] += x[i] * x[i];
        });
        const double norm = std::sqrt(rr);
        if (!each(norm / norm_b)) return {k, false};
        const double floor = 2 * 2.2e-16 * (norm_A * std::sqrt(xx) + norm_b);
        if (norm <= std::fmax(tolerance * norm_b, floor)) return {k, true};
        if (norm < best) {
            best = norm;
            best_at = k;
        } else if (k - best_at > STALLED) {
            return {k, false};
        }
        M.cycle(r.data(), z.data());
        const double old = rz;
        rz = dot(r.data(), z.data(), n);
        const double beta = rz / old;
        for_each(n, [&](int64_t i) { p[i] = z[i] + beta * p[i]; });
    }
    return {most, false};
}

}  // namespace kl
