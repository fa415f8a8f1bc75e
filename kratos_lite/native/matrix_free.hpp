// The stiffness of elements times a vector, element by element: the matrix itself is never made.
//
// Forces of elements are summed node by node in ascending order of elements, whatever the number of threads.

#pragma once
#include <algorithm>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

#include "element_products.hpp"
#include "sparse.hpp"
#include "turns.hpp"

namespace kl {

// Components x_i = sum w x_j that depend on others; where K is tied, T'K T takes its place.  The three of a
// node that depend alike on those of other nodes, as where it hangs, are one of `width` 3.
struct Ties {
    struct Share {
        int32_t node, tie;  // of an independent component, and the dependent one it takes a share of
        int axis;
        double weight;
    };
    std::vector<int32_t> dependents, start{0}, independents;  // the first components; dependents ascend
    std::vector<int> width;
    std::vector<double> weights;
    std::vector<Share> shares;       // sorted by nodes
    std::vector<int32_t> of;         // first share of each node, (n + 1)

    Ties() = default;
    Ties(const std::vector<int32_t>& rows, const std::vector<int32_t>& first, const std::vector<int32_t>& columns,
         const std::vector<double>& values, int64_t n) : of(n + 1, 0) {
        const auto alike = [&](size_t t, int c) {  // row t + c is row t, of the next axis
            bool same = t + c < rows.size() && rows[t] % 3 == 0 && rows[t + c] == rows[t] + c &&
                        first[t + c + 1] - first[t + c] == first[t + 1] - first[t];
            for (int32_t k = first[t], l = same ? first[t + c] : 0; same && k < first[t + 1]; ++k, ++l)
                same = columns[k] % 3 == 0 && columns[l] == columns[k] + c && values[l] == values[k];
            return same;
        };
        for (size_t t = 0; t < rows.size(); t += width.back()) {
            width.push_back(alike(t, 1) && alike(t, 2) ? 3 : 1);
            for (int32_t k = first[t]; k < first[t + 1]; ++k) {
                shares.push_back({columns[k] / 3, size(), columns[k] % 3, values[k]});
                ++of[columns[k] / 3 + 1];
            }
            dependents.push_back(rows[t]);
            independents.insert(independents.end(), columns.begin() + first[t], columns.begin() + first[t + 1]);
            weights.insert(weights.end(), values.begin() + first[t], values.begin() + first[t + 1]);
            start.push_back(static_cast<int32_t>(independents.size()));
        }
        std::stable_sort(shares.begin(), shares.end(), [](const Share& a, const Share& b) { return a.node < b.node; });
        std::partial_sum(of.begin(), of.end(), of.begin());
    }
    int32_t size() const { return static_cast<int32_t>(dependents.size()); }

    // Give dependent components of x (3n) what they depend on; three numbers behind the last are read.
    template <class T>
    void fill(T* x) const {
        for (int32_t t = 0; t < size(); ++t) {
            vec<T, 4> sum = {};
            for (int32_t k = start[t]; k < start[t + 1]; ++k)
                sum += static_cast<T>(weights[k]) * *reinterpret_cast<const vec<T, 4>*>(x + independents[k]);
            for (int c = 0; c < width[t]; ++c) x[dependents[t] + c] = sum[c];
        }
    }

    // The same of `count` vectors, B (3n, count).
    void fill_rows(std::vector<double>& B, int64_t count) const {
        for (int32_t t = 0; t < size(); ++t)
            for (int64_t e = 0; e < width[t] * count; ++e) {
                double sum = 0;
                for (int32_t k = start[t]; k < start[t + 1]; ++k) sum += weights[k] * B[independents[k] * count + e];
                B[dependents[t] * count + e] = sum;
            }
    }
};

// A multiple of a matrix with one number for all three components, such as a mass.
struct Multiple {
    double factor;
    BlockMatrix of;
};

class MatrixFree {
public:
    // With nodes at X (n, 3).
    MatrixFree(int64_t n, const double* X) : n(n), X(X, X + 3 * n) { this->X.push_back(0); }

    // Elements, whose arrays the caller keeps, with C = lambda, mu where it is isotropic.
    void add(const Elements& w, const TensorTables<double>& tensor) {
        groups.emplace_back();
        ProductGroup& s = groups.back();
        s.w = w;
        s.w.points = X.data();
        s.lambda = w.law.C[1];
        s.mu = w.law.C[21];
        s.dN.assign(w.dN, w.dN + 3 * static_cast<int64_t>(w.k) * w.g);
        s.first = pairs;
        s.width = 2 * vector_width();
        s.tensor64 = tensor;
        s.tensor32 = tensor.as<float>();
        pairs += w.last * w.k;
    }

    // Sum up which element vectors meet in each node; find the geometry.
    void prepare() {
        if (pairs > INT32_MAX) throw std::overflow_error("more than 2^31 nodes of elements");
        std::vector<int32_t> nodes;
        for (const ProductGroup& s : groups) nodes.insert(nodes.end(), s.w.nodes, s.w.nodes + s.w.last * s.w.k);
        members_of(nodes, n, start, met);
        for (ProductGroup& s : groups) find_places(s);
    }

    // done(i, y) with y = (K x)_i for each node i, by all threads; tied or not; in double precision K with a
    // multiple of a matrix added to it.
    template <class T, class F>
    void multiply(const T* x, const F& done, bool tied = true, const Multiple* added = nullptr) const {
        const auto turn = turns.take();
        std::vector<T>& room = std::get<std::vector<T>>(rooms);
        room.resize(4 * pairs);
        tied = tied && ties.size();
        if (tied) {
            std::vector<T>& filled = std::get<std::vector<T>>(filled_rooms);
            filled.resize(3 * n + 4);
            std::copy(x, x + 3 * n, filled.begin());
            ties.fill(filled.data());
            x = filled.data();
        }
        if constexpr (std::is_same_v<T, double>) {
            if (added) {
                of_added.resize(3 * n);
                kl::multiply(added->of, x, of_added.data(), 1, true);
            }
        }
        for (const ProductGroup& s : groups)
            over(s, [&](int64_t first, int64_t last) { run(s, x, room.data() + 4 * (s.first + first * s.w.k), first, last); });
        const auto force = [&](int64_t i, vec<T, 4>& sum) KL_INLINE_LAMBDA {
            sum = vec<T, 4>{};
            for (int c = 0; added && c < 3; ++c) sum[c] = static_cast<T>(added->factor * of_added[3 * i + c]);
            for (int32_t p = start[i]; p < start[i + 1]; ++p)
                sum += *reinterpret_cast<const vec<T, 4>*>(room.data() + 4 * static_cast<int64_t>(met[p]));
        };
        std::vector<T> passed_on(tied ? 4 * ties.size() : 0);
        parallel_ranges(tied ? ties.size() : 0, NODES, [&](int64_t first, int64_t last) {
            for (int64_t t = first; t < last; ++t)
                force(ties.dependents[t] / 3, *reinterpret_cast<vec<T, 4>*>(&passed_on[4 * t]));
        });
        parallel_ranges(n, NODES, [&](int64_t first, int64_t last) {
            for (int64_t i = first; i < last; ++i) {
                vec<T, 4> sum;
                force(i, sum);
                for (int32_t k = tied ? ties.of[i] : 0; tied && k < ties.of[i + 1]; ++k) {
                    const Ties::Share& s = ties.shares[k];
                    const T weight = static_cast<T>(s.weight), *f = &passed_on[4 * static_cast<int64_t>(s.tie)];
                    if (ties.width[s.tie] == 3)
                        sum += weight * *reinterpret_cast<const vec<T, 4>*>(f);
                    else
                        sum[s.axis] += weight * f[ties.dependents[s.tie] % 3];
                }
                const T y[3] = {sum[0], sum[1], sum[2]};
                done(i, y);
            }
        });
    }

    // x has a number behind its last; y may be x.
    template <class T>
    void multiply(const T* x, T* y, bool tied = true, const Multiple* added = nullptr) const {
        multiply(x, [&](int64_t i, const T* sum) { std::copy(sum, sum + 3, y + 3 * i); }, tied, added);
    }

    // The diagonal blocks, row-major; they are kept from `norm` on until they are taken.  Those of ties are
    // without the stiffness between a node and its dependents: good enough to smooth with.
    std::vector<double> diagonal() const {
        const auto turn = turns.take();
        std::vector<double> D = kept.empty() ? diagonal_blocks() : std::exchange(kept, {});
        const std::vector<double> untied = ties.size() ? D : std::vector<double>();
        const auto dependent = [&](int32_t k) { return ties.dependents[ties.shares[k].tie]; };
        for (int64_t i = 0; ties.size() && i < n; ++i)
            for (int32_t k = ties.of[i]; k < ties.of[i + 1]; ++k)  // shares of one dependent node follow each other
                for (int32_t l = k; l < ties.of[i + 1] && dependent(l) / 3 == dependent(k) / 3; ++l) {
                    const Ties::Share &a = ties.shares[k], &b = ties.shares[l];
                    const double w = a.weight * b.weight, *block = &untied[9 * (dependent(k) / 3)];
                    if (ties.width[a.tie] == 3) {
                        for (int e = 0; e < 9; ++e) D[9 * i + e] += w * block[e];
                        continue;
                    }
                    const double value = w * block[3 * (dependent(k) % 3) + dependent(l) % 3];
                    D[9 * i + 3 * a.axis + b.axis] += value;
                    if (l != k) D[9 * i + 3 * b.axis + a.axis] += value;
                }
        return D;
    }

    // The largest sum of |K| over a row among the nodes of an element at the stiffest node.
    double norm() const {
        const auto turn = turns.take();
        if (kept.empty()) kept = diagonal_blocks();
        const std::vector<double>& D = kept;
        int64_t stiffest = 0;
        double most = 0, largest = 0;
        for (int64_t i = 0; i < n; ++i) {
            const double entry = std::fmax(D[9 * i], std::fmax(D[9 * i + 4], D[9 * i + 8]));
            if (entry > most) {
                most = entry;
                stiffest = i;
            }
        }
        if (most == 0) return 0;
        const auto [group, element] = owner(met[start[stiffest]]);
        std::vector<double> x(3 * n + 1, 0.0), row(3 * n, 0.0);
        for (int a = 0; a < group->w.k; ++a)
            for (int c = 0; c < 3; ++c)
                largest = std::fmax(largest, row_sum(group->w.nodes[element * group->w.k + a], c, x, row));
        return largest;
    }

    int64_t bytes() const {
        int64_t all = 4 * static_cast<int64_t>(start.size() + met.size() + std::get<0>(rooms).size() + 2 * std::get<1>(rooms).size());
        for (const ProductGroup& s : groups) all += 4 * static_cast<int64_t>(s.geometry.size());
        all += static_cast<int64_t>(sizeof(Ties::Share) * ties.shares.size());
        return all;
    }

    int64_t n;
    Ties ties;

private:
    std::vector<double> diagonal_blocks() const {
        std::vector<double> each(6 * pairs), D(9 * n, 0.0);
        for (const ProductGroup& s : groups)
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

    // The group and the element of an element vector.
    std::pair<const ProductGroup*, int64_t> owner(int64_t place) const {
        const ProductGroup* s = &groups.back();
        while (s->first > place) --s;
        return {s, (place - s->first) / s->w.k};
    }

    // The sum of |K| over one row, which is that over the column; x and row are zero, and stay so.
    double row_sum(int32_t node, int c, std::vector<double>& x, std::vector<double>& row) const {
        std::vector<double> force;
        double sum = 0;
        x[3 * node + c] = 1;
        const auto for_rows = [&](const auto& f) {
            for (int32_t p = start[node]; p < start[node + 1]; ++p) {
                const auto [s, e] = owner(met[p]);
                const int k = s->w.k;
                force.resize(4 * k);
                run<double>(*s, x.data(), force.data(), e, e + 1);
                for (int i = 0; i < 3 * k; ++i) f(3 * int64_t{s->w.nodes[e * k + i / 3]} + i % 3, force[4 * (i / 3) + i % 3]);
            }
        };
        for_rows([&](int64_t i, double value) { row[i] += value; });
        for_rows([&](int64_t i, double) { sum += std::fabs(std::exchange(row[i], 0.0)); });
        x[3 * node + c] = 0;
        return sum;
    }

    template <class T>
    static void run(const ProductGroup& s, const T* x, T* out, int64_t first, int64_t last) {
        dispatch<T>([&](auto V) KL_INLINE_LAMBDA {
            Workspace space(V * (6 * s.w.k + 18 * s.w.g));
            element_forces<T, V>(s, x, out, first, last, reinterpret_cast<vec<T, V>*>(space.data()));
        });
    }

    static constexpr int64_t NODES = 4096, PLACES = 16;  // of one task

    // f(first, last) for ranges of the elements of a group.
    template <class F>
    static void over(const ProductGroup& s, const F& f) {
        parallel_ranges(s.places(), PLACES, [&](int64_t first, int64_t last) {
            f(first * s.width, std::min(s.w.last, last * s.width));
        });
    }

    static void find_places(ProductGroup& s) {
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

    mutable Turns turns;  // the element vectors serve one product at a time
    mutable std::tuple<std::vector<float>, std::vector<double>> rooms, filled_rooms;  // element vectors; x
    mutable std::vector<double> of_added;
    int64_t pairs = 0;
    mutable std::vector<double> kept;
    std::vector<double> X;
    std::vector<ProductGroup> groups;
    std::vector<int32_t> start, met;  // element vectors that meet in each node
};

}  // namespace kl
