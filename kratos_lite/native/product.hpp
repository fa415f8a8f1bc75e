// Products of the stiffness of elements from NumPy arrays, without a matrix.

#pragma once
#include "elements.hpp"
#include "matrix_free.hpp"

namespace kl {

// From places to points and to slopes (n, n), and from nodes to places (n^3, k), of a tensor product rule whose
// points come in the order of the places.
using Factors = std::optional<std::tuple<Array<double>, Array<double>, Array<double>>>;

inline TensorTables<double> tensor_tables(const Factors& factors, const Elements& w) {
    TensorTables<double> t;
    if (!factors) return t;
    const auto& [values, slopes, places] = *factors;
    t.n = static_cast<int>(values.shape(0));
    require((t.n == 2 || t.n == 3) && has_shape(values, t.n, t.n) && has_shape(slopes, t.n, t.n) &&
                w.g == t.n * t.n * t.n && has_shape(places, w.g, w.k),
            "factors must be two (n, n) with n = 2 or 3, and (n^3, k)");
    std::copy(values.data(), values.data() + values.size(), t.values);
    std::copy(slopes.data(), slopes.data() + slopes.size(), t.slopes);
    t.place.assign(w.k, -1);
    for (int p = 0; p < w.g; ++p) {
        const double* row = places.data() + static_cast<int64_t>(p) * w.k;
        const auto is_one = [](double weight) { return weight == 1; };
        const bool single = std::count(row, row + w.k, 0.0) == w.k - 1 && std::count_if(row, row + w.k, is_one);
        if (single)
            t.place[std::find_if(row, row + w.k, is_one) - row] = p;
        else {
            t.extra.push_back(p);
            t.weights.insert(t.weights.end(), row, row + w.k);
        }
    }
    for (int p : t.place) require(p >= 0, "each node must have a place");
    return t;
}

// Components of n nodes that depend on others: rows of weights.
inline Ties ties_of(const Array<int32_t>& dependents, const Array<int32_t>& indptr, const Array<int32_t>& independents,
                    const Array<double>& weights, int64_t n) {
    require(indptr.size() == dependents.size() + 1, "indptr must have a row for each dependent component");
    require(weights.size() == independents.size(), "one weight for each index is needed");
    check_rows(indptr, independents.size());
    require(are_rows(dependents, 3 * n) && are_rows(independents, 3 * n), "indices must be components of nodes");
    return Ties(dependents.copy(), indptr.copy(), independents.copy(), weights.copy(), n);
}

// Elements of a kind (nodes, dN, weights, C, factors), whose arrays are kept.
using ElementTables = std::tuple<Array<int32_t>, Array<double>, Array<double>, Array<double>, Factors>;

// A factor, and indptr, indices and numbers of a matrix.
using MultipleTables = std::optional<std::tuple<double, Array<int32_t>, Array<int32_t>, Array<double>>>;

class Product : public MatrixFree {
public:
    Product(Numbers points, std::vector<ElementTables> groups)
        : MatrixFree(points.size() / 3, points.data()), groups(std::move(groups)) {
        for (const auto& [nodes, dN, weights, C, factors] : this->groups) {
            Elements w = elements(points, nodes, dN, weights);
            set_law(w, C, {});
            add(w, tensor_tables(factors, w));
        }
        GilReleased release;
        prepare();
    }

    // Components that depend on others from now on, with their weights.
    void tie(Array<int32_t> dependents, Array<int32_t> indptr, Array<int32_t> independents, Array<double> weights) {
        ties = ties_of(dependents, indptr, independents, weights, n);
    }

    // K x of one vector (3n), or of several (k, 3n).
    Array<double> times(Array<double> x, bool tied, const MultipleTables& tables) const {
        const int64_t size = 3 * n, count = x.ndim() == 2 ? x.shape(0) : 1;
        require(x.size() == count * size && x.shape(x.ndim() - 1) == size, "x must have three numbers for each point");
        const std::optional<Multiple> added = multiple(tables);
        Array<double> y = x.ndim() == 2 ? Array<double>({count, size}) : Array<double>(size);
        if (count == 0) return y;
        const double* from = x.data();
        double* to = y.mutable_data();
        GilReleased release;
        std::vector<double> last(from + (count - 1) * size, from + count * size);
        last.push_back(0);  // behind the others stands a number, which is read
        for (int64_t v = 0; v < count; ++v)
            multiply(v + 1 < count ? from + v * size : last.data(), to + v * size, tied, added ? &*added : nullptr);
        return y;
    }

    // What the products of `times` have beside the elements; the tables keep its memory.
    std::optional<Multiple> multiple(const MultipleTables& tables) const {
        if (!tables) return {};
        const auto& [factor, indptr, indices, data] = *tables;
        require(indptr.size() == n + 1 && data.size() == indices.size(), "a matrix must have a row for each point");
        return Multiple{factor, {pattern(indptr, indices, n), data.data(), static_cast<uint32_t>(n)}};
    }

    double largest_row_sum() const {
        GilReleased release;
        return norm();
    }

private:
    std::vector<ElementTables> groups;
};

}  // namespace kl
