// Gradients at the points of a tensor product rule, one axis after another.
//
// The field of an element is a polynomial of degree n - 1 along each axis: known by its values on a grid of
// n^3 places, of which most shapes have a node at each, and just as well by those at the n^3 points.  From
// the first to the second leads one small matrix for each axis, and from these to their derivatives another.
// Source: Orszag, J. Comput. Phys. 37 (1980) 70-92; Kronbichler & Kormann, ACM TOMS 45 (2019) 29.

#pragma once
#include <algorithm>
#include <vector>

#include "isa.hpp"

namespace kl {

template <class T>
struct TensorTables {
    int n = 0;                 // points along each axis; 0 for other rules
    T values[9] = {}, slopes[9] = {};  // (n, n) from places to points, and from points to derivatives there
    std::vector<int> place;    // (k) of each node
    std::vector<int> extra;    // places without a node
    std::vector<T> weights;    // (extra, k) of the nodes there

    template <class U>
    TensorTables<U> as() const {
        TensorTables<U> t{n, {}, {}, place, extra, {weights.begin(), weights.end()}};
        std::copy(values, values + 9, t.values);
        std::copy(slopes, slopes + 9, t.slopes);
        return t;
    }
};

// to = M from along one axis, or M^T from; added to what is there, or in its place.
template <class T, int V, int n, int axis, bool transposed, bool added>
KL_INLINE void along(const T* M, const vec<T, V>* from, vec<T, V>* to) {
    constexpr int stride = axis == 0 ? 1 : axis == 1 ? n : n * n;
    for (int line = 0; line < n * n; ++line) {
        const int first = axis == 0 ? line * n : axis == 1 ? line / n * n * n + line % n : line;
        vec<T, V> in[n];
        for (int i = 0; i < n; ++i) in[i] = from[first + i * stride];
        for (int i = 0; i < n; ++i) {
            vec<T, V> sum = added ? to[first + i * stride] : vec<T, V>{};
            for (int j = 0; j < n; ++j) sum += in[j] * (transposed ? M[j * n + i] : M[i * n + j]);
            to[first + i * stride] = sum;
        }
    }
}

// R (points, 3, 3) of u (k, 3): for each component, values at the points and their slopes along each axis.
template <class T, int V, int n>
KL_INLINE void tensor_gradients(const TensorTables<T>& t, const vec<T, V>* u, vec<T, V>* slopes) {
    constexpr int size = n * n * n;
    const int k = static_cast<int>(t.place.size());
    for (int c = 0; c < 3; ++c, slopes += 3 * size) {
        vec<T, V> field[size];
        for (int a = 0; a < k; ++a) field[t.place[a]] = u[3 * a + c];
        for (size_t e = 0; e < t.extra.size(); ++e) {
            vec<T, V> sum = {};
            for (int a = 0; a < k; ++a) sum += t.weights[e * k + a] * u[3 * a + c];
            field[t.extra[e]] = sum;
        }
        along<T, V, n, 0, false, false>(t.values, field, field);
        along<T, V, n, 1, false, false>(t.values, field, field);
        along<T, V, n, 2, false, false>(t.values, field, field);
        along<T, V, n, 0, false, false>(t.slopes, field, slopes);
        along<T, V, n, 1, false, false>(t.slopes, field, slopes + size);
        along<T, V, n, 2, false, false>(t.slopes, field, slopes + 2 * size);
    }
}

// The transpose: nodal forces f (k, 3).
template <class T, int V, int n>
KL_INLINE void tensor_forces(const TensorTables<T>& t, const vec<T, V>* slopes, vec<T, V>* f) {
    constexpr int size = n * n * n;
    const int k = static_cast<int>(t.place.size());
    for (int c = 0; c < 3; ++c, slopes += 3 * size) {
        vec<T, V> field[size];
        along<T, V, n, 0, true, false>(t.slopes, slopes, field);
        along<T, V, n, 1, true, true>(t.slopes, slopes + size, field);
        along<T, V, n, 2, true, true>(t.slopes, slopes + 2 * size, field);
        along<T, V, n, 2, true, false>(t.values, field, field);
        along<T, V, n, 1, true, false>(t.values, field, field);
        along<T, V, n, 0, true, false>(t.values, field, field);
        for (int a = 0; a < k; ++a) f[3 * a + c] = field[t.place[a]];
        for (size_t e = 0; e < t.extra.size(); ++e)
            for (int a = 0; a < k; ++a) f[3 * a + c] += t.weights[e * k + a] * field[t.extra[e]];
    }
}

}  // namespace kl
