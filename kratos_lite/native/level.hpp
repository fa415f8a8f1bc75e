// One level of a multigrid hierarchy in float32: products and Chebyshev smoothing.

#pragma once
#include <cmath>
#include <cstdint>
#include <vector>

#include "clusters.hpp"

namespace kl {

using Floats = std::vector<float>;

constexpr int64_t VECTOR_GRAIN = 16384;  // numbers of one task on a vector

// One step of the smoother for some rows: s = c - A x, then d = alpha d + beta D^-1 s and next = x + d;
// or, without D, next = s alone.
template <int b>
struct Step {
    Graph g;
    const float* A;  // b x b blocks, column-major
    const float* Dinv;
    const float* c;
    const float* x;
    float* d;
    float* next;
    float alpha, beta;
    int64_t first, last;
};

template <int b>
KL_INLINE void step_rows(const Step<b>& s) {
    constexpr int W = b == 3 ? 4 : 8;  // lanes; those beyond b hold what is not used
    typedef vec<float, W> lane;
    for (int64_t i = s.first; i < s.last; ++i) {
        lane even = {}, odd = {};
        for (int32_t k = s.g.indptr[i]; k < s.g.indptr[i + 1]; ++k) {
            const float* a = s.A + static_cast<int64_t>(k) * b * b;
            const float* x = s.x + static_cast<int64_t>(s.g.indices[k]) * b;
            for (int j = 0; j < b; ++j) {
                lane& sum = j % 2 ? odd : even;
                sum += *reinterpret_cast<const lane*>(a + j * b) * x[j];
            }
        }
        const lane sum = even + odd;
        float r[b];
        for (int j = 0; j < b; ++j) r[j] = s.c[i * b + j] - sum[j];
        if (!s.Dinv) {
            for (int j = 0; j < b; ++j) s.next[i * b + j] = r[j];
            continue;
        }
        lane z = {};
        for (int j = 0; j < b; ++j) z += *reinterpret_cast<const lane*>(s.Dinv + i * b * b + j * b) * r[j];
        for (int j = 0; j < b; ++j) {
            const float d = s.alpha * s.d[i * b + j] + s.beta * z[j];
            s.d[i * b + j] = d;
            s.next[i * b + j] = s.x[i * b + j] + d;
        }
    }
}

template <int V>
KL_INLINE void step_rows_3(const Step<3>& s) { step_rows<3>(s); }
template <int V>
KL_INLINE void step_rows_6(const Step<6>& s) { step_rows<6>(s); }
KL_DISPATCH(step_some, step_rows_3, float, const Step<3>&)
KL_DISPATCH(step_some, step_rows_6, float, const Step<6>&)

class Level {
public:
    int b = 3;
    int64_t n = 0;
    Graph graph{};
    Ints own_indptr, own_indices;  // where the pattern is not borrowed
    Floats A, Dinv;
    float largest = 0;  // eigenvalue of D^-1 A, from above
    Floats x, y, d, c;
    Clusters clusters;  // where D is more than the diagonal blocks

    int64_t size() const { return n * b; }
    int64_t grain() const { return b == 3 ? 1024 : 128; }
    int64_t bytes() const { return 4 * static_cast<int64_t>(A.size() + Dinv.size() + 4 * x.size()) + clusters.bytes(); }

    // Solve exactly within clusters of the nodes at X, if it has any.
    void cluster(const double* data, const std::vector<uint8_t>& fixed, const double* X, double theta) {
        clusters = find_clusters(graph, data, b, X, theta);
        if (!clusters.empty()) clusters.factorise(graph, data, b, fixed);
    }

    // Take a float copy of the blocks with rows and columns of fixed components uncoupled, and the
    // inverse of the diagonal blocks, which is also returned in double.
    std::vector<double> take(const Graph& g, const double* data, const std::vector<uint8_t>& fixed, int block) {
        b = block;
        n = g.rows;
        graph = g;
        A.resize(static_cast<size_t>(g.indptr[n]) * b * b + 8);
        Dinv.assign(static_cast<size_t>(n) * b * b + 8, 0.0f);
        std::vector<double> inverse(static_cast<size_t>(n) * b * b);
        parallel_ranges(n, grain(), [&](int64_t first, int64_t last) {
            b == 3 ? take_rows<3>(data, fixed, inverse, first, last) : take_rows<6>(data, fixed, inverse, first, last);
        });
        for (Floats* v : {&x, &y, &d, &c}) v->assign(size() + 8, 0.0f);
        return inverse;
    }

    // next = x + d with d = alpha d + beta D^-1 (c - A x); or next = c - A x without smoothing.
    void step(const float* from, float* to, float alpha, float beta, bool smooth) {
        const float* inverse = smooth && clusters.empty() ? Dinv.data() : nullptr;
        parallel_ranges(n, grain(), [&](int64_t first, int64_t last) {
            if (b == 3)
                step_some(Step<3>{graph, A.data(), inverse, c.data(), from, d.data(), to, alpha, beta, first, last});
            else
                step_some(Step<6>{graph, A.data(), inverse, c.data(), from, d.data(), to, alpha, beta, first, last});
        });
        if (smooth && !clusters.empty()) clusters.step(b, to, from, d.data(), to, alpha, beta);
    }

    // d = beta D^-1 c and x = d: a first step from zero needs no product.
    void first_step(float beta) {
        if (!clusters.empty()) return clusters.step(b, c.data(), nullptr, d.data(), x.data(), 0, beta);
        parallel_ranges(n, 8 * grain(), [&](int64_t first, int64_t last) {
            for (int64_t i = first; i < last; ++i)
                for (int r = 0; r < b; ++r) {
                    float z = 0;
                    for (int j = 0; j < b; ++j) z += Dinv[(i * b + j) * b + r] * c[i * b + j];
                    d[i * b + r] = x[i * b + r] = beta * z;
                }
        });
    }

    // Chebyshev steps on A x = c over the upper part of the spectrum of D^-1 A; x starts at zero or as it is.
    // Source: Saad, Iterative Methods for Sparse Linear Systems (2003), algorithm 12.1.
    void smooth(int degree, float ratio, bool from_zero) {
        const float high = largest, low = largest / ratio;
        const float theta = (high + low) / 2, delta = (high - low) / 2, sigma = theta / delta;
        float rho = 1 / sigma;
        if (from_zero)
            first_step(1 / theta);
        else
            advance(0, 1 / theta);
        for (int k = 1; k < degree; ++k) {
            const float old = rho;
            rho = 1 / (2 * sigma - old);
            advance(rho * old, 2 * rho / delta);
        }
    }

    void residual(Floats& out) { step(x.data(), out.data(), 0, 0, false); }

private:
    void advance(float alpha, float beta) {
        step(x.data(), y.data(), alpha, beta, true);
        x.swap(y);
    }

    template <int B>
    void take_rows(const double* data, const std::vector<uint8_t>& fixed, std::vector<double>& inverse,
                   int64_t first, int64_t last) {
        for (int64_t i = first; i < last; ++i)
            for (int32_t k = graph.indptr[i]; k < graph.indptr[i + 1]; ++k) {
                const int64_t j = graph.indices[k];
                double block[B * B];
                for (int r = 0; r < B; ++r)
                    for (int c = 0; c < B; ++c) {
                        const bool apart = fixed[i * B + r] || fixed[j * B + c];
                        block[r * B + c] = apart && !(i == j && r == c) ? 0.0 : data[(k * int64_t{B} + r) * B + c];
                    }
                for (int r = 0; r < B; ++r)
                    for (int c = 0; c < B; ++c) A[(k * int64_t{B} + c) * B + r] = static_cast<float>(block[r * B + c]);
                if (i != j) continue;
                invert<B>(block, &inverse[i * B * B]);
                for (int r = 0; r < B; ++r)
                    for (int c = 0; c < B; ++c)
                        Dinv[(i * B + c) * B + r] = static_cast<float>(inverse[(i * B + r) * B + c]);
            }
    }
};

inline double dot(const float* x, const float* y, int64_t n) {
    constexpr int64_t CHUNK = 8192;
    std::vector<double> parts((n + CHUNK - 1) / CHUNK);
    parallel_ranges(n, CHUNK, [&](int64_t first, int64_t last) {
        double sum = 0;
        for (int64_t i = first; i < last; ++i) sum += static_cast<double>(x[i]) * y[i];
        parts[first / CHUNK] = sum;
    });
    double sum = 0;
    for (double part : parts) sum += part;
    return sum;
}

// The largest eigenvalue of a symmetric tridiagonal matrix, by bisection.
inline double largest_of(const std::vector<double>& diagonal, const std::vector<double>& beside) {
    double low = 0, high = 0;
    for (size_t i = 0; i < diagonal.size(); ++i) {
        const double left = i ? std::fabs(beside[i - 1]) : 0;
        const double right = i + 1 < diagonal.size() ? std::fabs(beside[i]) : 0;
        high = std::fmax(high, diagonal[i] + left + right);
    }
    for (int step = 0; step < 50; ++step) {
        const double middle = (low + high) / 2;
        bool above = false;  // is an eigenvalue above the middle?
        double pivot = 1;
        for (size_t i = 0; i < diagonal.size() && !above; ++i) {
            pivot = diagonal[i] - middle - (i ? beside[i - 1] * beside[i - 1] / pivot : 0);
            above = pivot >= 0;
        }
        (above ? low : high) = middle;
    }
    return high;
}

// The largest eigenvalue of D^-1 A from a few steps of conjugate gradients (its Lanczos values), with
// a margin for the steps not made.  Works in the level's vectors.
// Source: Saad, Iterative Methods for Sparse Linear Systems (2003), section 6.7.3.
inline float largest_eigenvalue(Level& level, int steps = 15) {
    const int64_t size = level.size();
    Floats r(size + 8), z(size + 8);
    uint32_t noise = 12345;
    for (int64_t i = 0; i < size; ++i) {
        noise = noise * 1664525u + 1013904223u;
        r[i] = static_cast<float>(noise >> 8) / 16777216.0f - 0.5f;
    }
    std::fill(level.c.begin(), level.c.end(), 0.0f);
    std::vector<double> diagonal, beside;
    double alpha = 0, beta = 0, rz = 0;
    for (int k = 0; k < steps; ++k) {
        level.c.swap(r);
        level.first_step(1);  // d = x = D^-1 r
        level.c.swap(r);
        const double old_rz = rz, old_alpha = alpha;
        rz = dot(r.data(), level.x.data(), size);
        if (!(rz > 0)) break;
        beta = k ? rz / old_rz : 0;
        parallel_ranges(size, VECTOR_GRAIN, [&](int64_t first, int64_t last) {
            for (int64_t i = first; i < last; ++i) z[i] = level.x[i] + static_cast<float>(beta) * z[i];
        });
        level.step(z.data(), level.y.data(), 0, 0, false);  // y = -A z
        const double curvature = -dot(z.data(), level.y.data(), size);
        if (!(curvature > 0)) break;
        alpha = rz / curvature;
        if (k) beside.push_back(std::sqrt(beta) / old_alpha);
        diagonal.push_back(1 / alpha + (k ? beta / old_alpha : 0));
        parallel_ranges(size, VECTOR_GRAIN, [&](int64_t first, int64_t last) {
            for (int64_t i = first; i < last; ++i) r[i] += static_cast<float>(alpha) * level.y[i];
        });
    }
    for (Floats* v : {&level.x, &level.y, &level.d}) std::fill(v->begin(), v->end(), 0.0f);
    return diagonal.empty() ? 1.0f : static_cast<float>(1.15 * largest_of(diagonal, beside));
}

}  // namespace kl
