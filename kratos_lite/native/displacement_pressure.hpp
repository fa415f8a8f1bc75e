// Displacements and pressures of nearly incompressible elements: flexible GMRES with a multigrid cycle for
// the displacements and conjugate gradients for the pressures; see solvers/displacement_pressure.py.

#pragma once
#include "conjugate_gradients.hpp"

namespace kl {

// D of blocks R x 3, one row of blocks for each R pressures, and the blocks in each of its columns.
struct Dilatations : Graph {
    const double* data;
    int R;
    Transposed columns;

    void dilate(const double* u, double* q) const { R == 4 ? dilate<4>(u, q) : dilate<1>(u, q); }
    void load(const double* p, double* f) const { R == 4 ? load<4>(p, f) : load<1>(p, f); }

private:
    static constexpr int64_t GRAIN = 512;

    // q = D u
    template <int r>
    void dilate(const double* u, double* q) const {
        parallel_ranges(rows, GRAIN, [&](int64_t first, int64_t last) {
            for (int64_t e = first; e < last; ++e) {
                double sum[r] = {};
                for (int32_t k = indptr[e]; k < indptr[e + 1]; ++k) {
                    const double* d = data + int64_t{k} * r * 3;
                    const double* x = u + 3 * int64_t{indices[k]};
                    for (int i = 0; i < r; ++i) sum[i] += d[3 * i] * x[0] + d[3 * i + 1] * x[1] + d[3 * i + 2] * x[2];
                }
                for (int i = 0; i < r; ++i) q[e * r + i] = sum[i];
            }
        });
    }

    // f = D^T p
    template <int r>
    void load(const double* p, double* f) const {
        const int64_t nodes = static_cast<int64_t>(columns.indptr.size()) - 1;
        parallel_ranges(nodes, GRAIN, [&](int64_t first, int64_t last) {
            for (int64_t n = first; n < last; ++n) {
                double sum[3] = {};
                for (int32_t k = columns.indptr[n]; k < columns.indptr[n + 1]; ++k) {
                    const double* d = data + int64_t{columns.entries[k]} * r * 3;
                    const double* x = p + int64_t{columns.rows[k]} * r;
                    for (int i = 0; i < r; ++i)
                        for (int c = 0; c < 3; ++c) sum[c] += d[3 * i + c] * x[i];
                }
                for (int c = 0; c < 3; ++c) f[3 * n + c] = sum[c];
            }
        });
    }
};

// S of blocks R x R, scaled to a diagonal of 1; padded by the numbers that a vector reads beyond the last block.
struct PressureOperator : Graph {
    const float* data;
    const double* scale;
    int R;
    double share;  // of the energy, at which a solution ends
    int most;      // iterations
    Floats x, r, p, Sp;

    int64_t size() const { return rows * R; }

    // z = S^-1 b, roughly, by conjugate gradients.
    void solve(const double* b, double* z) {
        const int64_t n = size();
        for (Floats* v : {&x, &r, &p, &Sp}) v->resize(n);
        double largest = 0;
        for (int64_t i = 0; i < n; ++i) largest = std::fmax(largest, std::fabs(scale[i] * b[i]));
        std::fill(z, z + n, 0.0);
        if (!(largest > 0)) return;
        std::fill(x.begin(), x.end(), 0.0f);
        for (int64_t i = 0; i < n; ++i) p[i] = r[i] = static_cast<float>(scale[i] * b[i] / largest);
        double rr = dot(r.data(), r.data(), n);
        const double end = share * rr;
        for (int k = 0; k < most && rr > end; ++k) {
            R == 4 ? multiply<4>() : multiply<1>();
            const double curvature = dot(p.data(), Sp.data(), n);
            if (!(curvature > 0)) break;
            const float alpha = static_cast<float>(rr / curvature);
            for_each(n, [&](int64_t i) {
                x[i] += alpha * p[i];
                r[i] -= alpha * Sp[i];
            });
            const double old = rr;
            rr = dot(r.data(), r.data(), n);
            const float beta = static_cast<float>(rr / old);
            for_each(n, [&](int64_t i) { p[i] = r[i] + beta * p[i]; });
        }
        for (int64_t i = 0; i < n; ++i) z[i] = scale[i] * largest * x[i];
    }

private:
    template <int b>
    void multiply() {
        parallel_ranges(rows, b == 1 ? 4096 : 512, [&](int64_t first, int64_t last) {
            for (int64_t e = first; e < last; ++e) b == 1 ? row(e) : row_of_blocks(e);
        });
    }

    void row(int64_t e) {
        float sum[4] = {};
        int32_t k = indptr[e];
        for (; k + 3 < indptr[e + 1]; k += 4)
            for (int i = 0; i < 4; ++i) sum[i] += data[k + i] * p[indices[k + i]];
        for (; k < indptr[e + 1]; ++k) sum[0] += data[k] * p[indices[k]];
        Sp[e] = (sum[0] + sum[1]) + (sum[2] + sum[3]);
    }

    void row_of_blocks(int64_t e) {
        typedef vec<float, 4> Vec;
        Vec sum[4] = {};
        for (int32_t k = indptr[e]; k < indptr[e + 1]; ++k) {
            const float* s = data + int64_t{k} * 16;
            const Vec v = *reinterpret_cast<const Vec*>(&p[4 * int64_t{indices[k]}]);
            for (int i = 0; i < 4; ++i) sum[i] += *reinterpret_cast<const Vec*>(s + 4 * i) * v;
        }
        for (int i = 0; i < 4; ++i) Sp[4 * e + i] = (sum[i][0] + sum[i][1]) + (sum[i][2] + sum[i][3]);
    }
};

// w -= h v; returns the product of what is left with `next`, or with itself.
inline double subtract(double* w, double h, const double* v, const double* next, int64_t n) {
    return sums<1>(n, [&](int64_t i, auto& sum) {
        w[i] -= h * v[i];
        sum[0] += w[i] * (next ? next[i] : w[i]);
    })[0];
}

// Directions Z and their products with the matrix, of which the residual is made as small as can be.
// Source: Saad, SIAM J. Sci. Comput. 14 (1993) 461-469.
class Directions {
public:
    double start = 0;  // norm of the residual
    size_t count = 0;

    void begin(const Doubles& r) {
        const int64_t n = static_cast<int64_t>(r.size());
        start = std::sqrt(dot(r.data(), r.data(), n));
        count = 0;
        g.assign(1, start);
        add(r, start);
    }

    const Doubles& last() const { return V[count]; }

    // Where the next direction is to be.
    Floats& next() {
        if (Z.size() == count) Z.emplace_back(V[0].size());
        return Z[count];
    }

    // Take the next direction with its product w; returns the smallest norm that the residual can have.
    double extend(Doubles& w) {
        const int64_t n = static_cast<int64_t>(w.size());
        Doubles h(count + 2);
        h[0] = dot(V[0].data(), w.data(), n);
        for (size_t j = 0; j <= count; ++j)
            h[j + 1] = subtract(w.data(), h[j], V[j].data(), j < count ? V[j + 1].data() : nullptr, n);
        h[count + 1] = std::sqrt(h[count + 1]);
        ++count;
        add(w, h[count]);
        return rotate(h);
    }

    // x changed along the directions so that the residual is smallest.
    void add_to(Doubles& x) const {
        Doubles y(g.begin(), g.begin() + count);
        for (size_t i = count; i-- > 0;) {
            for (size_t j = i + 1; j < count; ++j) y[i] -= R[j][i] * y[j];
            y[i] = R[i][i] != 0 ? y[i] / R[i][i] : 0;
        }
        for_each(static_cast<int64_t>(x.size()), [&](int64_t i) {
            for (size_t j = 0; j < count; ++j) x[i] += y[j] * Z[j][i];
        });
    }

private:
    void add(const Doubles& v, double norm) {
        if (V.size() == count) V.emplace_back(v.size());
        const double factor = norm > 0 ? 1 / norm : 1;
        for_each(static_cast<int64_t>(v.size()), [&](int64_t i) { V[count][i] = factor * v[i]; });
    }

    // Givens rotations make the matrix of the products triangular.
    double rotate(Doubles& h) {
        const size_t k = count - 1;
        cosines.resize(k);
        sines.resize(k);
        R.resize(k);
        for (size_t i = 0; i < k; ++i) {
            const double a = h[i], b = h[i + 1];
            h[i] = cosines[i] * a + sines[i] * b;
            h[i + 1] = cosines[i] * b - sines[i] * a;
        }
        const double size = std::hypot(h[k], h[k + 1]);
        cosines.push_back(size > 0 ? h[k] / size : 1);
        sines.push_back(size > 0 ? h[k + 1] / size : 0);
        h[k] = size;
        R.push_back(h);
        g.resize(k + 1);
        g.push_back(-sines[k] * g[k]);
        g[k] *= cosines[k];
        return std::fabs(g[k + 1]);
    }

    std::vector<Doubles> V;
    std::vector<Floats> Z;
    std::vector<Doubles> R;
    Doubles cosines, sines, g;
};

struct Limits {
    int most;         // iterations
    int directions;   // iterations after which they start anew
    double reduced;   // share of the residual at which they start anew
};

class DisplacementPressure {
public:
    DisplacementPressure(const BlockMatrix& A, const Bytes& fixed, Hierarchy& M, Dilatations D, PressureOperator S,
                         const double* bulk, const double* kept, Doubles weight)
        : A(A), fixed(fixed), M(M), D(std::move(D)), S(std::move(S)), bulk(bulk), kept(kept), weight(std::move(weight)),
          n(3 * A.rows), size(n + this->S.size()), forces(n), u(n), p(size - n), rest(size - n) {}

    // x (n + pressures) of K u = b; `each` takes the residuals as shares of the first, and may say stop.
    template <class Each>
    Outcome solve(const double* b, double* out, double tolerance, double norm, const Limits& limits, const Each& each) {
        Doubles x(size, 0.0), found, r(size);
        std::fill(out, out + n, 0.0);
        const double norm_b = std::sqrt(dot(b, b, n));
        if (norm_b == 0) return {0, true};
        residual(b, x, r);
        weigh(r);
        Directions space;
        space.begin(r);
        const double first = space.start;
        double aim = tolerance * first, before = INFINITY;
        for (int k = 1;; ++k) {
            const double estimate = extend(space, r);
            const bool stop = !each(estimate / first);
            const bool exhausted = space.count == static_cast<size_t>(limits.directions) ||
                                   estimate <= limits.reduced * space.start || k == limits.most;
            if (!(stop || exhausted || estimate <= aim)) continue;
            found = x;
            space.add_to(found);
            residual(b, found, r);
            const double left = of_displacements(r);
            const double rounding = 2 * 2.2e-16 * (norm * std::sqrt(dot(found.data(), found.data(), n)) + norm_b);
            const double limit = std::fmax(rounding, tolerance * norm_b);
            if (left <= limit || stop || k == limits.most || (exhausted && left > before / 2)) {
                std::copy(found.begin(), found.begin() + n, out);
                return {k, left <= limit};
            }
            aim = estimate * std::fmin(limit / left, 0.5);
            if (!exhausted) continue;
            x = found;
            before = left;
            weigh(r);
            space.begin(r);
        }
    }

private:
    // One more direction: the preconditioner on the last vector, and the product with the matrix, into w.
    double extend(Directions& space, Doubles& w) {
        const Doubles& v = space.last();
        Floats& z = space.next();
        for_each(size - n, [&](int64_t i) { rest[i] = v[n + i] / weight[n + i]; });
        S.solve(rest.data(), p.data());
        for_each(size - n, [&](int64_t i) {
            z[n + i] = static_cast<float>(-p[i] - kept[i] * rest[i]);
            p[i] = z[n + i];
        });
        D.load(p.data(), forces.data());
        for_each(n, [&](int64_t i) { u[i] = weight[i] > 0 ? v[i] / weight[i] - forces[i] : 0; });
        M.cycle(u.data(), w.data());
        for_each(n, [&](int64_t i) { u[i] = z[i] = static_cast<float>(w[i]); });
        multiply(A, u.data(), w.data());
        D.dilate(u.data(), rest.data());
        for_each(n, [&](int64_t i) { w[i] = weight[i] * (w[i] + forces[i]); });
        for_each(size - n, [&](int64_t i) { w[n + i] = weight[n + i] * (rest[i] - p[i] / bulk[i]); });
        return space.extend(w);
    }

    void residual(const double* b, const Doubles& x, Doubles& r) {
        multiply(A, x.data(), r.data());
        D.load(x.data() + n, forces.data());
        D.dilate(x.data(), rest.data());
        for_each(n, [&](int64_t i) { r[i] = fixed[i] ? 0 : b[i] - r[i] - forces[i]; });
        for_each(size - n, [&](int64_t i) { r[n + i] = x[n + i] / bulk[i] - rest[i]; });
    }

    void weigh(Doubles& r) const {
        for_each(size, [&](int64_t i) { r[i] *= weight[i]; });
    }

    // |b - K u|: the pressures that the displacements have are not quite those found.
    double of_displacements(const Doubles& r) {
        for_each(size - n, [&](int64_t i) { rest[i] = bulk[i] * r[n + i]; });
        D.load(rest.data(), forces.data());
        for_each(n, [&](int64_t i) { forces[i] = fixed[i] ? 0 : forces[i] + r[i]; });
        return std::sqrt(dot(forces.data(), forces.data(), n));
    }

    const BlockMatrix A;
    const Bytes& fixed;
    Hierarchy& M;
    Dilatations D;
    PressureOperator S;
    const double *bulk, *kept;
    Doubles weight;  // residuals are measured by the energy that they stand for; 0 at fixed components
    int64_t n, size;
    Doubles forces, u, p, rest;
};

}  // namespace kl
