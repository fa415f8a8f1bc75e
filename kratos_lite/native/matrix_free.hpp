// The stiffness of elements times a vector, element by element: the matrix itself is never made.
//
// From nodal values u come the gradients R = du/dxi at the Gauss points of V elements at once, from these
// H = R J^-1, the stress C sym(H), and F = stress J^-T w det J; the forces of node a are sum_q F dN_a.
// In single precision, for smoothing, J^-1 and w det J are kept; where J is constant, once for all points.
// In double precision they are found anew from the coordinates, which takes less time than to read them.
// Forces of elements are summed node by node in ascending order of elements, whatever the number of threads.

#pragma once
#include <utility>
#include <vector>

#include "gauss.hpp"
#include "sparse.hpp"
#include "sum_factorization.hpp"

namespace kl {

// Elements that share tables and material.
struct FreeGroup {
    Elements w;
    std::vector<float> dN;        // (g, k, 3)
    int64_t first = 0;            // of the element vectors, counted in nodes
    int width = 0;                // elements that share a place in `geometry`, one in each lane
    std::vector<int64_t> start;   // of each of these places
    std::vector<float> geometry;  // (places, 1 or g, 10, width): J^-1 and det J
    double lambda = 0, mu = 0;
    TensorTables<float> tensor32;
    TensorTables<double> tensor64;

    bool affine(int64_t e) const { return start[e / width + 1] - start[e / width] == 10 * width; }
    int64_t places() const { return (w.last + width - 1) / width; }
};

// Columns 0 … 2 of four rows.
template <class T>
KL_INLINE void transpose_rows(const vec<T, 4> (&r)[4], vec<T, 4> (&c)[3]) {
    vec<T, 4> low[2], high[2];
    for (int h = 0; h < 2; ++h) {
        pick<T, 4, 0, 4, 1, 5>(low[h], r[2 * h], r[2 * h + 1]);
        pick<T, 4, 2, 6, 3, 7>(high[h], r[2 * h], r[2 * h + 1]);
    }
    pick<T, 4, 0, 1, 4, 5>(c[0], low[0], low[1]);
    pick<T, 4, 2, 3, 6, 7>(c[1], low[0], low[1]);
    pick<T, 4, 0, 1, 4, 5>(c[2], high[0], high[1]);
}

// Four rows of three columns and one of zeros.
template <class T>
KL_INLINE void transpose_columns(const vec<T, 4> (&c)[3], vec<T, 4> (&r)[4]) {
    const vec<T, 4> zero = {};
    vec<T, 4> low[2], high[2];
    pick<T, 4, 0, 4, 1, 5>(low[0], c[0], c[1]);
    pick<T, 4, 2, 6, 3, 7>(high[0], c[0], c[1]);
    pick<T, 4, 0, 4, 1, 5>(low[1], c[2], zero);
    pick<T, 4, 2, 6, 3, 7>(high[1], c[2], zero);
    pick<T, 4, 0, 1, 4, 5>(r[0], low[0], low[1]);
    pick<T, 4, 2, 3, 6, 7>(r[1], low[0], low[1]);
    pick<T, 4, 0, 1, 4, 5>(r[2], high[0], high[1]);
    pick<T, 4, 2, 3, 6, 7>(r[3], high[0], high[1]);
}

// Values x (n, 3) at the nodes of V elements; a number behind the last of x is read, but not used.
template <class T, int V>
KL_INLINE void gather_nodal(const FreeGroup& s, const T* x, int64_t e, vec<T, V>* to) {
    T* flat = reinterpret_cast<T*>(to);
    const int k = s.w.k;
    constexpr int W = V % 4 ? 1 : 4;
    for (int lane = 0; lane < V; lane += W) {
        const int32_t* nodes[W];
        for (int l = 0; l < W; ++l) nodes[l] = s.w.nodes + std::min(e + lane + l, s.w.last - 1) * k;
        for (int a = 0; a < k; ++a) {
            if constexpr (W == 4) {
                vec<T, 4> rows[4], columns[3];
                for (int l = 0; l < 4; ++l)
                    rows[l] = *reinterpret_cast<const vec<T, 4>*>(x + 3 * static_cast<int64_t>(nodes[l][a]));
                transpose_rows<T>(rows, columns);
                for (int i = 0; i < 3; ++i) *reinterpret_cast<vec<T, 4>*>(flat + (3 * a + i) * V + lane) = columns[i];
            } else {
                for (int i = 0; i < 3; ++i) flat[(3 * a + i) * V + lane] = x[3 * static_cast<int64_t>(nodes[0][a]) + i];
            }
        }
    }
}

// Element vectors (k, 4) of V elements, of which the fourth numbers are not used.
template <class T, int V>
KL_INLINE void store_nodal(const vec<T, V>* from, int k, int64_t lanes, T* out) {
    const T* flat = reinterpret_cast<const T*>(from);
    if constexpr (V % 4 == 0) {
        if (lanes == V) {
            for (int lane = 0; lane < V; lane += 4, out += 16 * k)
                for (int a = 0; a < k; ++a) {
                    vec<T, 4> rows[4], columns[3];
                    for (int i = 0; i < 3; ++i)
                        columns[i] = *reinterpret_cast<const vec<T, 4>*>(flat + (3 * a + i) * V + lane);
                    transpose_columns<T>(columns, rows);
                    for (int l = 0; l < 4; ++l) *reinterpret_cast<vec<T, 4>*>(out + 4 * (l * k + a)) = rows[l];
                }
            return;
        }
    }
    for (int64_t lane = 0; lane < lanes; ++lane)
        for (int a = 0; a < k; ++a)
            for (int i = 0; i < 3; ++i) out[4 * (lane * k + a) + i] = flat[(3 * a + i) * V + lane];
}

// R_ij = sum_a u_ai dN_aj
template <class T, int V>
KL_INLINE void reference_gradient_of(const vec<T, V>* u, const T* dN, int k, vec<T, V> (&R)[3][3]) {
    vec<T, V> sum[3][3] = {};
    for (int a = 0; a < k; ++a, u += 3, dN += 3)
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) sum[i][j] += u[i] * dN[j];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) R[i][j] = sum[i][j];
}

// F = C sym(R G) G^T dV with G = J^-1.
template <class T, int V>
KL_INLINE void stress_forces(const FreeGroup& s, const vec<T, V> (&R)[3][3], const vec<T, V>* G, const vec<T, V>& dV,
                             vec<T, V>* F) {
    typedef vec<T, V> Vec;
    Vec H[3][3], S[3][3];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) H[i][j] = R[i][0] * G[j] + R[i][1] * G[3 + j] + R[i][2] * G[6 + j];
    if (s.w.law.isotropic) {
        const Vec mu = static_cast<T>(s.mu) * dV, pressure = static_cast<T>(s.lambda) * dV * (H[0][0] + H[1][1] + H[2][2]);
        for (int i = 0; i < 3; ++i) {
            const int j = (i + 1) % 3;
            S[i][i] = pressure + (mu + mu) * H[i][i];
            S[i][j] = S[j][i] = mu * (H[i][j] + H[j][i]);
        }
    } else {
        const Vec E[6] = {H[0][0], H[1][1], H[2][2], H[0][1] + H[1][0], H[1][2] + H[2][1], H[2][0] + H[0][2]};
        Vec v[6];
        for (int c = 0; c < 6; ++c) {
            Vec sum = {};
            for (int d = 0; d < 6; ++d) sum += static_cast<T>(s.w.law.C[6 * c + d]) * E[d];
            v[c] = sum * dV;
        }
        for (int i = 0; i < 3; ++i) {
            S[i][i] = v[i];
            S[i][(i + 1) % 3] = S[(i + 1) % 3][i] = v[3 + i];
        }
    }
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) F[3 * i + j] = S[i][0] * G[3 * j] + S[i][1] * G[3 * j + 1] + S[i][2] * G[3 * j + 2];
}

template <class T>
KL_INLINE const TensorTables<T>& tensor(const FreeGroup& s) {
    if constexpr (std::is_same_v<T, float>) return s.tensor32;
    else return s.tensor64;
}

// Forces of `count` nodes from `a` on; together they use each F that is loaded.
template <class T, int V, int count>
KL_INLINE void sum_forces(const vec<T, V>* F, const T* dN, int k, int g, int a, vec<T, V>* f) {
    vec<T, V> sum[count][3] = {};
    for (int q = 0; q < g; ++q, F += 9) {
        const T* at = dN + 3 * (q * static_cast<int64_t>(k) + a);
        for (int n = 0; n < count; ++n)
            for (int i = 0; i < 3; ++i)
                sum[n][i] += F[3 * i] * at[3 * n] + F[3 * i + 1] * at[3 * n + 1] + F[3 * i + 2] * at[3 * n + 2];
    }
    for (int n = 0; n < count; ++n)
        for (int i = 0; i < 3; ++i) f[3 * (a + n) + i] = sum[n][i];
}

// J^-1 and det J in double, of J from the coordinates or, at `kept` with others behind each other, as it is.
template <int V>
KL_INLINE void find_geometry(const FreeGroup& s, const vec<double, V>* X, int q, vec<double, V>* G, vec<double, V>& det,
                             const vec<double, V>* kept = nullptr) {
    vec<double, V> J[3][3], c[3][3];
    if (kept)
        for (int e = 0; e < 9; ++e) J[e / 3][e % 3] = kept[e * s.w.g + q];
    else
        reference_gradient_of<double, V>(X, s.w.dN_at(q), s.w.k, J);
    invert<V>(J, c, det);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) G[3 * i + j] = c[i][j] / det;
}

template <class T>
const T* table(const FreeGroup& s) {
    if constexpr (std::is_same_v<T, float>) return s.dN.data();
    else return s.w.dN;
}

// Gradients (3, 3, g) of u (k, 3), where the rule has factors.
template <class T, int V>
KL_INLINE void gradients_by_axis(const FreeGroup& s, const vec<T, V>* u, vec<T, V>* out) {
    if (tensor<T>(s).n == 2)
        tensor_gradients<T, V, 2>(tensor<T>(s), u, out);
    else if (tensor<T>(s).n == 3)
        tensor_gradients<T, V, 3>(tensor<T>(s), u, out);
}

// Element vectors (m, k, 4) of elements [first, last).
template <class T, int V>
KL_INLINE void element_forces(const FreeGroup& s, const T* x, T* out, int64_t first, int64_t last, vec<T, V>* space) {
    typedef vec<T, V> Vec;
    const int k = s.w.k, g = s.w.g;
    const T* dN = table<T>(s);
    Vec *u = space, *F = u + 3 * k, *X = F + 9 * g, *J = X + 3 * k;
    for (int64_t e = first; e < last; e += V) {
        gather_nodal<T, V>(s, x, e, u);
        const bool affine = s.affine(e);
        const float* kept = s.geometry.data() + s.start[e / s.width];
        if constexpr (std::is_same_v<T, double>) {
            gather_nodal<T, V>(s, s.w.points, e, X);
            shift_to_first_node<V>(X, k);
            if (!affine) gradients_by_axis<T, V>(s, X, J);
        }
        gradients_by_axis<T, V>(s, u, F);
        Vec G[9] = {}, det = {};
        for (int q = 0; q < g; ++q) {
            if (q == 0 || !affine) {
                if constexpr (std::is_same_v<T, double>) {
                    find_geometry<V>(s, X, q, G, det, affine || !tensor<T>(s).n ? nullptr : J);
                } else {
                    const Vec* at = reinterpret_cast<const Vec*>(kept + 10 * V * q);
                    for (int c = 0; c < 9; ++c) G[c] = at[c];
                    det = at[9];
                }
            }
            const Vec dV = det * static_cast<T>(s.w.weights[q]);
            Vec R[3][3], S[9];
            if (tensor<T>(s).n) {
                for (int c = 0; c < 9; ++c) R[c / 3][c % 3] = F[c * g + q];
                stress_forces<T, V>(s, R, G, dV, S);
                for (int c = 0; c < 9; ++c) F[c * g + q] = S[c];
            } else {
                reference_gradient_of<T, V>(u, dN + 3 * static_cast<int64_t>(k) * q, k, R);
                stress_forces<T, V>(s, R, G, dV, F + 9 * q);
            }
        }
        if (tensor<T>(s).n == 2) {
            tensor_forces<T, V, 2>(tensor<T>(s), F, u);
        } else if (tensor<T>(s).n == 3) {
            tensor_forces<T, V, 3>(tensor<T>(s), F, u);
        } else {
            int a = 0;
            for (; a + 3 <= k; a += 3) sum_forces<T, V, 3>(F, dN, k, g, a, u);
            for (; a < k; ++a) sum_forces<T, V, 1>(F, dN, k, g, a, u);
        }
        store_nodal<T, V>(u, k, std::min<int64_t>(V, last - e), out + e * 4 * k);
    }
}

// Diagonal blocks (m, k, 6) of elements [first, last), as xx yy zz xy yz zx.
template <int V>
KL_INLINE void element_diagonals(const FreeGroup& s, double* out, int64_t first, int64_t last, vec<double, V>* space) {
    typedef vec<double, V> Vec;
    const int k = s.w.k, g = s.w.g;
    Vec *X = space, *K = X + 3 * k;
    for (int64_t e = first; e < last; e += V) {
        gather_nodal<double, V>(s, s.w.points, e, X);
        shift_to_first_node<V>(X, k);
        for (int c = 0; c < 6 * k; ++c) K[c] = Vec{};
        for (int q = 0; q < g; ++q) {
            Vec G[9], det;
            find_geometry<V>(s, X, q, G, det);
            const Vec dV = det * s.w.weights[q];
            const double* dN = s.w.dN_at(q);
            for (int a = 0; a < k; ++a) {
                Vec D[3], R[3][3], F[9];
                for (int j = 0; j < 3; ++j) D[j] = dN[3 * a] * G[j] + dN[3 * a + 1] * G[3 + j] + dN[3 * a + 2] * G[6 + j];
                if (s.w.law.isotropic) {
                    const Vec both = (s.lambda + s.mu) * dV, trace = s.mu * dV * (D[0] * D[0] + D[1] * D[1] + D[2] * D[2]);
                    for (int i = 0; i < 3; ++i) {
                        K[6 * a + i] += both * D[i] * D[i] + trace;
                        K[6 * a + 3 + i] += both * D[i] * D[(i + 1) % 3];
                    }
                    continue;
                }
                for (int i = 0; i < 3; ++i) {  // column i: the force of a unit displacement
                    for (int r = 0; r < 3; ++r)
                        for (int j = 0; j < 3; ++j) R[r][j] = r == i ? dN[3 * a + j] + Vec{} : Vec{};
                    stress_forces<double, V>(s, R, G, dV, F);
                    for (int r : {i, (i + 1) % 3}) {
                        const Vec force = F[3 * r] * dN[3 * a] + F[3 * r + 1] * dN[3 * a + 1] + F[3 * r + 2] * dN[3 * a + 2];
                        K[6 * a + (r == i ? i : 3 + i)] += force;
                    }
                }
            }
        }
        const double* flat = reinterpret_cast<const double*>(K);
        const int64_t lanes = std::min<int64_t>(V, last - e);
        for (int64_t lane = 0; lane < lanes; ++lane)
            for (int c = 0; c < 6 * k; ++c) out[(e + lane) * 6 * k + c] = flat[c * V + lane];
    }
}

// J^-1 and det J of the elements of some places, (1 or g, 10, width) each.
template <int V>
KL_INLINE void store_geometry(FreeGroup& s, int64_t first, int64_t last, vec<double, V>* X) {
    for (int64_t e = first * s.width; e < last * s.width; e += V) {
        gather_nodal<double, V>(s, s.w.points, e, X);
        shift_to_first_node<V>(X, s.w.k);
        float* to = s.geometry.data() + s.start[e / s.width] + e % s.width;
        const int points = s.affine(e) ? 1 : s.w.g;
        for (int q = 0; q < points; ++q, to += 10 * s.width) {
            vec<double, V> G[10];
            find_geometry<V>(s, X, q, G, G[9]);
            for (int c = 0; c < 10; ++c)
                for (int lane = 0; lane < V; ++lane) to[c * s.width + lane] = static_cast<float>(G[c][lane]);
        }
    }
}

// Whether J is constant in all elements of a place.
template <int V>
KL_INLINE bool is_affine(const FreeGroup& s, int64_t place, vec<double, V>* X) {
    vec<double, V>(*J)[3][3] = reinterpret_cast<vec<double, V>(*)[3][3]>(X + 3 * s.w.k);
    for (int64_t e = place * s.width; e < (place + 1) * s.width; e += V) {
        gather_nodal<double, V>(s, s.w.points, e, X);
        for (int q = 0; q < s.w.g; ++q) reference_gradient_of<double, V>(X, s.w.dN_at(q), s.w.k, J[q]);
        if (!constant<V>(s.w.k, s.w.g, X, &J[0][0][0])) return false;
    }
    return true;
}

class MatrixFree {
public:
    // With nodes at X (n, 3).
    MatrixFree(int64_t n, const double* X) : n(n), X(X, X + 3 * n) { this->X.push_back(0); }

    // Elements, whose arrays the caller keeps, with C = lambda, mu where it is isotropic.
    void add(const Elements& w, const TensorTables<double>& tensor) {
        groups.emplace_back();
        FreeGroup& s = groups.back();
        s.w = w;
        s.w.points = X.data();
        s.lambda = w.law.C[1];
        s.mu = w.law.C[21];
        s.dN.assign(w.dN, w.dN + 3 * static_cast<int64_t>(w.k) * w.g);
        s.first = pairs;
        s.width = 2 * vector_width();
        s.tensor64 = tensor;
        s.tensor32.n = tensor.n;
        s.tensor32.place = tensor.place;
        s.tensor32.extra = tensor.extra;
        std::copy(tensor.values, tensor.values + 9, s.tensor32.values);
        std::copy(tensor.slopes, tensor.slopes + 9, s.tensor32.slopes);
        s.tensor32.weights.assign(tensor.weights.begin(), tensor.weights.end());
        pairs += w.last * w.k;
    }

    // Sum up which element vectors meet in each node; find the geometry.
    void prepare() {
        if (pairs > INT32_MAX) throw std::overflow_error("more than 2^31 nodes of elements");
        start.assign(n + 1, 0);
        for (const FreeGroup& s : groups)
            for (int64_t p = 0; p < s.w.last * s.w.k; ++p) ++start[s.w.nodes[p] + 1];
        for (int64_t i = 0; i < n; ++i) start[i + 1] += start[i];
        met.resize(pairs);
        std::vector<int32_t> next(start.begin(), start.end() - 1);
        for (const FreeGroup& s : groups)
            for (int64_t p = 0; p < s.w.last * s.w.k; ++p)
                met[next[s.w.nodes[p]]++] = static_cast<int32_t>(s.first + p);
        for (FreeGroup& s : groups) find_places(s);
    }

    // done(i, y) with y = (K x)_i for each node i, by all threads.
    template <class T, class F>
    void multiply(const T* x, std::vector<T>& room, const F& done) const {
        room.resize(4 * pairs);
        for (const FreeGroup& s : groups)
            over(s, [&](int64_t first, int64_t last) { run(s, x, room.data() + 4 * s.first, first, last); });
        parallel_ranges(n, NODES, [&](int64_t first, int64_t last) {
            for (int64_t i = first; i < last; ++i) {
                vec<T, 4> sum = {};
                for (int32_t p = start[i]; p < start[i + 1]; ++p)
                    sum += *reinterpret_cast<const vec<T, 4>*>(room.data() + 4 * static_cast<int64_t>(met[p]));
                const T y[3] = {sum[0], sum[1], sum[2]};
                done(i, y);
            }
        });
    }

    // x has a number behind its last.
    void multiply(const double* x, double* y) const {
        multiply(x, doubles, [&](int64_t i, const double* sum) { std::copy(sum, sum + 3, y + 3 * i); });
    }

    // The diagonal blocks, row-major; they are kept from `norm` on until they are taken.
    std::vector<double> diagonal() const {
        if (!kept.empty()) return std::exchange(kept, {});
        std::vector<double> each(6 * pairs), D(9 * n, 0.0);
        for (const FreeGroup& s : groups)
            over(s, [&](int64_t first, int64_t last) {
                dispatch<double>([&](auto V) KL_INLINE_LAMBDA {
                    Workspace space(V * 9 * s.w.k);
                    element_diagonals<V>(s, each.data() + 6 * s.first, first, last,
                                         reinterpret_cast<vec<double, V>*>(space.data()));
                });
            });
        parallel_ranges(n, NODES, [&](int64_t first, int64_t last) {
            const int at[9] = {0, 3, 5, 3, 1, 4, 5, 4, 2};
            for (int64_t i = first; i < last; ++i)
                for (int32_t p = start[i]; p < start[i + 1]; ++p)
                    for (int e = 0; e < 9; ++e) D[9 * i + e] += each[6 * static_cast<int64_t>(met[p]) + at[e]];
        });
        return D;
    }

    // The largest sum of |K| over a row among the nodes of an element at the stiffest node.
    double norm() const {
        if (kept.empty()) kept = diagonal();
        const std::vector<double>& D = kept;
        int64_t stiffest = 0;
        double most = 0, largest = 0;
        for (int64_t i = 0; i < n; ++i) {
            const double trace = D[9 * i] + D[9 * i + 4] + D[9 * i + 8];
            if (trace > most) {
                most = trace;
                stiffest = i;
            }
        }
        if (start[stiffest] == start[stiffest + 1]) return 0;
        const auto [group, element] = owner(met[start[stiffest]]);
        std::vector<double> x(3 * n + 1, 0.0), row(3 * n, 0.0), force;
        for (int a = 0; a < group->w.k; ++a)
            for (int c = 0; c < 3; ++c) largest = std::fmax(largest, row_sum(group->w.nodes[element * group->w.k + a], c, x, row, force));
        return largest;
    }

    int64_t bytes() const {
        int64_t all = 4 * static_cast<int64_t>(start.size() + met.size() + floats.size() + 2 * doubles.size());
        for (const FreeGroup& s : groups) all += 4 * static_cast<int64_t>(s.geometry.size());
        return all;
    }

    int64_t n;
    mutable std::vector<float> floats;    // element vectors
    mutable std::vector<double> doubles;

private:
    // The group and the element of an element vector.
    std::pair<const FreeGroup*, int64_t> owner(int64_t place) const {
        const FreeGroup* s = &groups.back();
        while (s->first > place) --s;
        return {s, (place - s->first) / s->w.k};
    }

    // The sum of |K| over one row, which is that over the column; x and row are zero, and stay so.
    double row_sum(int32_t node, int c, std::vector<double>& x, std::vector<double>& row,
                   std::vector<double>& force) const {
        double sum = 0;
        x[3 * node + c] = 1;
        const auto for_rows = [&](const auto& f) {
            for (int32_t p = start[node]; p < start[node + 1]; ++p) {
                const auto [s, e] = owner(met[p]);
                const int k = s->w.k;
                force.resize(4 * (e + 1) * k);
                run<double>(*s, x.data(), force.data(), e, e + 1);
                for (int i = 0; i < 3 * k; ++i) f(3 * int64_t{s->w.nodes[e * k + i / 3]} + i % 3, force[4 * (e * k + i / 3) + i % 3]);
            }
        };
        for_rows([&](int64_t i, double value) { row[i] += value; });
        for_rows([&](int64_t i, double) { sum += std::fabs(std::exchange(row[i], 0.0)); });
        x[3 * node + c] = 0;
        return sum;
    }

    template <class T>
    static void run(const FreeGroup& s, const T* x, T* out, int64_t first, int64_t last) {
        dispatch<T>([&](auto V) KL_INLINE_LAMBDA {
            Workspace space(V * (6 * s.w.k + 18 * s.w.g));
            element_forces<T, V>(s, x, out, first, last, reinterpret_cast<vec<T, V>*>(space.data()));
        });
    }

    static constexpr int64_t NODES = 4096, PLACES = 16;  // of one task

    // f(first, last) for ranges of the elements of a group.
    template <class F>
    static void over(const FreeGroup& s, const F& f) {
        parallel_ranges(s.places(), PLACES, [&](int64_t first, int64_t last) {
            f(first * s.width, std::min(s.w.last, last * s.width));
        });
    }

    static void find_places(FreeGroup& s) {
        const int64_t places = s.places();
        std::vector<uint8_t> affine(places);
        const auto with_room = [&](const auto& f) {
            parallel_ranges(places, PLACES, [&](int64_t first, int64_t last) {
                dispatch<double>([&](auto V) KL_INLINE_LAMBDA {
                    Workspace space(V * (3 * s.w.k + 9 * s.w.g));
                    f(V, first, last, reinterpret_cast<vec<double, V>*>(space.data()));
                });
            });
        };
        with_room([&](auto V, int64_t first, int64_t last, auto* X) KL_INLINE_LAMBDA {
            for (int64_t p = first; p < last; ++p) affine[p] = is_affine<V>(s, p, X);
        });
        s.start.assign(places + 1, 0);
        for (int64_t p = 0; p < places; ++p)
            s.start[p + 1] = s.start[p] + 10 * s.width * (affine[p] ? 1 : s.w.g);
        s.geometry.resize(s.start[places]);
        with_room([&](auto V, int64_t first, int64_t last, auto* X) KL_INLINE_LAMBDA {
            store_geometry<V>(s, first, last, X);
        });
    }

    int64_t pairs = 0;
    mutable std::vector<double> kept;
    std::vector<double> X;
    std::vector<FreeGroup> groups;
    std::vector<int32_t> start, met;  // element vectors that meet in each node
};

}  // namespace kl
