// One level of a multigrid hierarchy in float32: products and Chebyshev smoothing.

#pragma once
#include <memory>

#include "matrix_free.hpp"
#include "patches.hpp"
#include "several.hpp"

namespace kl {

// Some rows of s = c - A x, summed in the precision of Sum, then d = alpha d + beta D^-1 s and next = x + d;
// or, without D, next = s alone.  Blocks are column-major.
template <int b, class Sum>
KL_INLINE void step_rows(const Graph& g, const float* A, const float* Dinv, const float* c, const float* from,
                         float* d, float* next, float alpha, float beta, int64_t first, int64_t last) {
    constexpr int W = b == 3 ? 4 : 8;  // numbers of a vector; those beyond b hold what is not used
    typedef vec<float, W> Vec;
    typedef vec<Sum, W> Sums;
    for (int64_t i = first; i < last; ++i) {
        Sums even = {}, odd = {};
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k) {
            const float* a = A + static_cast<int64_t>(k) * b * b;
            const float* x = from + static_cast<int64_t>(g.indices[k]) * b;
            for (int j = 0; j < b; ++j)
                (j % 2 ? odd : even) +=
                    __builtin_convertvector(*reinterpret_cast<const Vec*>(a + j * b), Sums) * static_cast<Sum>(x[j]);
        }
        const Sums sum = even + odd;
        float r[b];
        for (int j = 0; j < b; ++j) r[j] = static_cast<float>(c[i * b + j] - sum[j]);
        if (!Dinv) {
            for (int j = 0; j < b; ++j) next[i * b + j] = r[j];
            continue;
        }
        Vec z = {};
        for (int j = 0; j < b; ++j) z += *reinterpret_cast<const Vec*>(Dinv + i * b * b + j * b) * r[j];
        for (int j = 0; j < b; ++j) {
            const float change = alpha * d[i * b + j] + beta * z[j];
            d[i * b + j] = change;
            next[i * b + j] = from[i * b + j] + change;
        }
    }
}

// out = c - A x of some rows with the row-major blocks of the matrix itself; x is zero at held components,
// where out becomes zero.
KL_INLINE void residual_rows(const Graph& g, const double* A, const uint8_t* held, const float* c, const float* x,
                             float* out, int64_t first, int64_t last) {
    typedef vec<double, 4> Vec;
    for (int64_t i = first; i < last; ++i) {
        Vec sums[3] = {};
        for (int32_t k = g.indptr[i]; k < g.indptr[i + 1]; ++k) {
            const double* a = A + int64_t{k} * 9;
            const float* v = x + int64_t{g.indices[k]} * 3;
            const Vec low = {v[0], v[1], v[2], 0}, high = {0, v[0], v[1], v[2]};
            sums[0] += *reinterpret_cast<const Vec*>(a) * low;
            sums[1] += *reinterpret_cast<const Vec*>(a + 3) * low;
            sums[2] += *reinterpret_cast<const Vec*>(a + 5) * high;
        }
        for (int r = 0; r < 3; ++r) {
            const double sum = (sums[r][0] + sums[r][1]) + (sums[r][2] + sums[r][3]);
            out[3 * i + r] = held[3 * i + r] ? 0.0f : static_cast<float>(c[3 * i + r] - sum);
        }
    }
}

// How ranks keep the nodes of a level that they share in step; one process has nothing to do.
struct Halo {
    virtual ~Halo() = default;
    virtual void update(float*) const {}  // give copies of nodes, behind the own ones, what their owners have
    virtual void add(float*) const {}     // add what copies have to what their owners have
    virtual double sum(double x) const { return x; }
    virtual double max(double x) const { return x; }
    virtual bool solve(float*, float*) const { return false; }  // A x = c on the coarsest level
};

class Level {
public:
    int b = 3;
    int64_t n = 0;  // own nodes; copies of those of other ranks stand behind them
    std::shared_ptr<const Halo> halo = std::make_shared<Halo>();
    uint32_t noise = 12345;  // from which the largest eigenvalue is found
    Graph graph{};
    Ints own_indptr, own_indices;  // where the pattern is not borrowed
    Floats A, Dinv;
    const MatrixFree* elements = nullptr;  // in place of A
    float largest = 0;  // eigenvalue of D^-1 A, from above
    Floats x, y, d, c;
    Clusters clusters;  // where D is more than the diagonal blocks
    Patches patches;    // what smooths in place of D, if any
    bool thin = false;  // energies so unlike that sums take double precision
    const double* exact = nullptr;  // in place of A, where energies are still more unlike
    Bytes held;                     // fixed components, which neither of them leaves out
    int vectors = 1;                // of a cycle; where they are more, x, y, d and c hold SEVERAL

    int64_t size() const { return n * b; }
    int64_t grain() const { return b == 3 ? 1024 : 128; }
    int64_t numbers() const { return elements ? 0 : int64_t{graph.indptr[n]} * b * b; }
    int64_t bytes() const {
        return 4 * static_cast<int64_t>(A.size() + Dinv.size() + 4 * x.size()) + clusters.bytes() + patches.bytes() +
               (elements ? elements->bytes() : 0);
    }

    // Nodes without free components, and copies.
    Bytes excluded(const Bytes& fixed) const {
        Bytes out(fixed.size() / b, 1);
        for (int64_t i = 0; i < n; ++i) out[i] = !std::count(&fixed[i * b], &fixed[i * b] + b, 0);
        return out;
    }

    // Solve exactly within clusters of the nodes at X, if it has any.
    void cluster(const double* data, const Bytes& fixed, const double* X, double theta, double far) {
        clusters = find_clusters(graph, data, b, fixed, X, theta, far);
        if (!clusters.empty()) clusters.factorize(graph, data, b, fixed);
    }

    // Solve exactly within each `size` nodes that follow one another.
    void cluster_equally(const double* data, const Bytes& fixed, int32_t size) {
        Ints label(n);
        for (int64_t i = 0; i < n; ++i) label[i] = static_cast<int32_t>(i / size * size);
        clusters = {};
        clusters.collect(graph, label);
        clusters.factorize(graph, data, b, fixed);
    }

    // Make a float copy of the blocks with rows and columns of fixed components uncoupled, and the
    // inverse of the diagonal blocks, which is also returned in double.
    Doubles set_matrix(const Graph& g, const double* data, const Bytes& fixed, int block, bool in_double = false) {
        graph = g;
        allocate(g.rows, block, fixed);
        if (in_double) {
            exact = data;
            held = fixed;
        } else {
            A.resize(numbers() + 8);
        }
        Doubles inverse(size() * b);
        parallel_ranges(n, grain(), [&](int64_t first, int64_t last) {
            with_size(b, [&](auto B) { set_rows<B>(data, fixed, inverse, first, last); });
        });
        return inverse;
    }

    // Take the product of elements, the first of whose nodes are own ones, in place of a matrix; return the
    // inverse of the diagonal blocks in double.
    Doubles set_elements(const MatrixFree& product, const Bytes& fixed, int64_t own) {
        elements = &product;
        held = fixed;
        allocate(own, 3, fixed);
        Doubles D = product.diagonal();
        parallel_ranges(n, grain(), [&](int64_t first, int64_t last) {
            for (int64_t i = first; i < last; ++i) {
                double block[9];
                for (int e = 0; e < 9; ++e)
                    block[e] = e % 4 && (fixed[3 * i + e / 3] || fixed[3 * i + e % 3]) ? 0.0 : D[9 * i + e];
                invert<3>(block, &D[9 * i]);
                std::copy(&D[9 * i], &D[9 * i] + 9, &Dinv[9 * i]);
            }
        });
        return D;
    }

    // next = x + d with d = alpha d + beta D^-1 (c - A x); or next = c - A x without smoothing.
    void step(float* from, float* to, float alpha, float beta, bool smooth) {
        halo->update(from);
        if (vectors > 1) return step_several(from, to, alpha, beta, smooth);
        if (elements) return step_elements(from, to, alpha, beta, smooth);
        const bool single = clusters.empty() && patches.empty();
        const float* inverse = smooth && single ? Dinv.data() : nullptr;
        parallel_ranges(n, grain(), [&](int64_t first, int64_t last) {
            if (exact)
                return dispatch<double>([&](auto) KL_INLINE_LAMBDA {
                    residual_rows(graph, exact, held.data(), c.data(), from, to, first, last);
                });
            with_size(b, [&](auto B) {
                thin ? step<B, double>(inverse, from, to, alpha, beta, first, last)
                     : step<B, float>(inverse, from, to, alpha, beta, first, last);
            });
        });
        if (!smooth) return;
        if (!patches.empty())
            patches.step(b, to, from, d.data(), to, alpha, beta);
        else if (!clusters.empty())
            clusters.step(b, to, from, d.data(), to, alpha, beta);
        else if (exact)
            add_step(from, to, alpha, beta);
    }

    // d = beta D^-1 c and x = d: a first step from zero needs no product.
    void first_step(float beta) {
        if (vectors > 1) return change_several(of(c), nullptr, of(x), 0, beta);
        if (!patches.empty()) return patches.step(b, c.data(), nullptr, d.data(), x.data(), 0, beta);
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

    // Whether a cycle takes several vectors at once.
    bool serves_several() const { return !thin && !exact && clusters.empty() && patches.empty(); }

    // Let the next cycle be one of `count` vectors.
    void set_vectors(int count) {
        vectors = count;
        for (Floats* v : {&x, &y, &d, &c})
            if (count > 1) v->resize(SEVERAL * size() + 8);
    }

    static Several* of(Floats& v) { return reinterpret_cast<Several*>(v.data()); }

    void residual(Floats& out) { step(x.data(), out.data(), 0, 0, false); }

private:
    Floats apart;  // several vectors, each behind the other

    void allocate(int64_t own, int block, const Bytes& fixed) {
        n = own;
        b = block;
        Dinv.assign(size() * b + 8, 0.0f);
        for (Floats* v : {&x, &y, &d, &c}) v->assign(fixed.size() + 8, 0.0f);
    }

    template <int B, class Sum>
    void step(const float* inverse, const float* from, float* to, float alpha, float beta, int64_t first,
              int64_t last) {
        dispatch<float>([&](auto) KL_INLINE_LAMBDA {
            step_rows<B, Sum>(graph, A.data(), inverse, c.data(), from, d.data(), to, alpha, beta, first, last);
        });
    }

    void step_elements(const float* from, float* to, float alpha, float beta, bool smooth) {
        elements->multiply(from, [&](int64_t i, const float* sum) {
            if (i >= n) return;
            float r[3];
            for (int j = 0; j < 3; ++j) r[j] = held[3 * i + j] ? 0.0f : c[3 * i + j] - sum[j];
            if (!smooth) {
                std::copy(r, r + 3, to + 3 * i);
                return;
            }
            const float* D = &Dinv[9 * i];
            for (int j = 0; j < 3; ++j) {
                float& change = d[3 * i + j];
                change = alpha * change + beta * (D[j] * r[0] + D[3 + j] * r[1] + D[6 + j] * r[2]);
                to[3 * i + j] = from[3 * i + j] + change;
            }
        });
    }

    void step_several(const float* from, float* to, float alpha, float beta, bool smooth) {
        const Several* x = reinterpret_cast<const Several*>(from);
        Several* next = reinterpret_cast<Several*>(to);
        if (elements)
            residual_of_elements(x, next);
        else
            with_size(b, [&](auto B) {
                for_rows(n, [&](int64_t i) KL_INLINE_LAMBDA {
                    residual_row<decltype(B)::value>(graph, A.data(), of(c), x, i, next);
                });
            });
        if (smooth) change_several(next, x, next, alpha, beta);
    }

    // r = c - A x with the elements, one vector after another: in vectors of their own they take fewer bytes.
    void residual_of_elements(const Several* x, Several* r) {
        const int64_t N = size() + 1;  // a number behind the last is read
        apart.resize(N * vectors);
        for_rows(size(), [&](int64_t i) KL_INLINE_LAMBDA {
            for (int v = 0; v < vectors; ++v) apart[v * N + i] = x[i][v];
        });
        for (int v = 0; v < vectors; ++v) elements->multiply(&apart[v * N], &apart[v * N]);
        for_rows(size(), [&](int64_t i) KL_INLINE_LAMBDA {
            Several sum = {};
            for (int v = 0; v < vectors; ++v) sum[v] = apart[v * N + i];
            r[i] = held[i] ? Several{} : of(c)[i] - sum;
        });
    }

    // d = alpha d + beta D^-1 r and next = from + d, or both = beta D^-1 r without from.
    void change_several(const Several* r, const Several* from, Several* next, float alpha, float beta) {
        with_size(b, [&](auto B) {
            for_rows(n, [&](int64_t i) KL_INLINE_LAMBDA {
                constexpr int b = decltype(B)::value;
                change<b>(&Dinv[i * b * b], r + i * b, from ? from + i * b : nullptr, of(d) + i * b, next + i * b, alpha, beta);
            });
        });
    }

    // The rest of a step with the diagonal blocks: `to` is the residual and becomes from + d.
    void add_step(const float* from, float* to, float alpha, float beta) {
        parallel_ranges(n, 8 * grain(), [&](int64_t first, int64_t last) {
            for (int64_t i = first; i < last; ++i) {
                float z[MODES] = {};
                for (int j = 0; j < b; ++j)
                    for (int r = 0; r < b; ++r) z[r] += Dinv[(i * b + j) * b + r] * to[i * b + j];
                for (int r = 0; r < b; ++r) {
                    d[i * b + r] = alpha * d[i * b + r] + beta * z[r];
                    to[i * b + r] = from[i * b + r] + d[i * b + r];
                }
            }
        });
    }

    void advance(float alpha, float beta) {
        step(x.data(), y.data(), alpha, beta, true);
        x.swap(y);
    }

    template <int B>
    void set_rows(const double* data, const Bytes& fixed, Doubles& inverse,
                   int64_t first, int64_t last) {
        for (int64_t i = first; i < last; ++i)
            for (int32_t k = graph.indptr[i]; k < graph.indptr[i + 1]; ++k) {
                const int64_t j = graph.indices[k];
                double block[B * B];
                for (int r = 0; r < B; ++r)
                    for (int c = 0; c < B; ++c) {
                        const bool decoupled = fixed[i * B + r] || fixed[j * B + c];
                        block[r * B + c] = decoupled && !(i == j && r == c) ? 0.0 : data[(k * int64_t{B} + r) * B + c];
                    }
                for (int r = 0; r < B; ++r)
                    for (int c = 0; c < B && !exact; ++c)
                        A[(k * int64_t{B} + c) * B + r] = static_cast<float>(block[r * B + c]);
                if (i != j) continue;
                invert<B>(block, &inverse[i * B * B]);
                for (int r = 0; r < B; ++r)
                    for (int c = 0; c < B; ++c)
                        Dinv[(i * B + c) * B + r] = static_cast<float>(inverse[(i * B + r) * B + c]);
            }
    }
};

// The largest eigenvalue of a symmetric tridiagonal matrix, by bisection.
inline double largest_tridiagonal(const Doubles& diagonal, const Doubles& off_diagonal) {
    double low = 0, high = 0;
    for (size_t i = 0; i < diagonal.size(); ++i) {
        const double left = i ? std::fabs(off_diagonal[i - 1]) : 0;
        const double right = i + 1 < diagonal.size() ? std::fabs(off_diagonal[i]) : 0;
        high = std::fmax(high, diagonal[i] + left + right);
    }
    for (int step = 0; step < 50; ++step) {
        const double middle = (low + high) / 2;
        bool above = false;  // is an eigenvalue above the middle?
        double pivot = 1;
        for (size_t i = 0; i < diagonal.size() && !above; ++i) {
            pivot = diagonal[i] - middle - (i ? off_diagonal[i - 1] * off_diagonal[i - 1] / pivot : 0);
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
    Floats r(level.x.size()), z(level.x.size());
    uint32_t noise = level.noise;
    for (int64_t i = 0; i < size; ++i) {
        noise = noise * 1664525u + 1013904223u;
        if (level.held.empty() || !level.held[i]) r[i] = static_cast<float>(noise >> 8) / 16777216.0f - 0.5f;
    }
    std::fill(level.c.begin(), level.c.end(), 0.0f);
    Doubles diagonal, off_diagonal;
    double alpha = 0, beta = 0, rz = 0;
    for (int k = 0; k < steps; ++k) {
        level.c.swap(r);
        level.first_step(1);  // d = x = D^-1 r
        level.c.swap(r);
        const double old_rz = rz, old_alpha = alpha;
        rz = level.halo->sum(dot(r.data(), level.x.data(), size));
        if (!(rz > 0)) break;
        beta = k ? rz / old_rz : 0;
        for_each(size, [&](int64_t i) { z[i] = level.x[i] + static_cast<float>(beta) * z[i]; });
        level.step(z.data(), level.y.data(), 0, 0, false);  // y = -A z
        const double curvature = -level.halo->sum(dot(z.data(), level.y.data(), size));
        if (!(curvature > 0)) break;
        alpha = rz / curvature;
        if (k) off_diagonal.push_back(std::sqrt(beta) / old_alpha);
        diagonal.push_back(1 / alpha + (k ? beta / old_alpha : 0));
        for_each(size, [&](int64_t i) { r[i] += static_cast<float>(alpha) * level.y[i]; });
    }
    for (Floats* v : {&level.x, &level.y, &level.d}) std::fill(v->begin(), v->end(), 0.0f);
    return diagonal.empty() ? 1.0f : static_cast<float>(1.15 * largest_tridiagonal(diagonal, off_diagonal));
}

}  // namespace kl
