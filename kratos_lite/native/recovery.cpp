// Recovery of smooth fields from values at points of elements, and the energy of what they differ by.

#include <algorithm>
#include <vector>

#include "arrays.hpp"
#include "recovery.hpp"

namespace {

using namespace kl;

constexpr int64_t GRAIN = 64;  // patches, nodes or elements of one task

void require_rows(Indices start, int64_t size, const char* what) {
    check_rows(start, size);
    require(start.size() > 0, what);
}

py::tuple fitted(Numbers X, Numbers values, Indices offset, Indices start, Indices elements, Numbers weights,
                 Indices degree, Indices means) {
    const int64_t s = X.shape(0), patches = start.size() - 1;
    require(has_shape(X, s, 3) && has_shape(values, s, 6), "places must be (s, 3), values (s, 6)");
    require_rows(offset, s, "offset must be (m + 1)");
    require_rows(start, elements.size(), "start must be (p + 1)");
    require(are_rows(elements, offset.size() - 1), "elements of patches must be rows");
    require(weights.size() == elements.size(), "weights must be those of the elements of the patches");
    require(degree.size() == patches && means.size() == patches, "degree and means must be (p)");
    require(are_rows(degree, 4), "degrees run from 0 to 3");
    Array<double> frame({static_cast<py::ssize_t>(patches), py::ssize_t{12}});
    Array<double> terms({static_cast<py::ssize_t>(patches), py::ssize_t{TERMS}, py::ssize_t{6}});
    const int64_t m = offset.size() - 1;
    const bool simple = std::any_of(means.data(), means.data() + patches, [](int32_t mean) { return mean != 0; });
    std::vector<double> mean(simple ? 9 * m : 0);
    const Fit fit{X.data(),       values.data(), offset.data(), start.data(), elements.data(),        weights.data(),
                  degree.data(), means.data(),  mean.data(),   frame.mutable_data(), terms.mutable_data()};
    {
        py::gil_scoped_release release;
        if (simple)
            parallel_ranges(m, 8 * GRAIN, [&](int64_t first, int64_t last) {
                for (int64_t e = first; e < last; ++e) mean_samples(fit, e, mean.data() + 9 * e);
            });
        parallel_ranges(patches, GRAIN, [&](int64_t first, int64_t last) { fit_patches({&fit, first, last}); });
    }
    return py::make_tuple(frame, terms);
}

Array<double> evaluated(Numbers frame, Numbers terms, Numbers X, Indices start, Indices patches) {
    const int64_t n = X.shape(0), p = frame.shape(0);
    require(has_shape(frame, p, 12), "frame must be (p, 12)");
    require(terms.size() == p * TERMS * 6, "terms must be (p, 20, 6)");
    require(has_shape(X, n, 3) && start.size() == n + 1, "places must be (n, 3), start (n + 1)");
    require_rows(start, patches.size(), "start must be (n + 1)");
    require(are_rows(patches, p), "patches must be rows of the fits");
    Array<double> out({static_cast<py::ssize_t>(n), py::ssize_t{6}});
    double* to = out.mutable_data();
    const double *at = X.data(), *frames = frame.data(), *coefficients = terms.data();
    const int32_t *from = start.data(), *rows = patches.data();
    py::gil_scoped_release release;
    parallel_ranges(n, 8 * GRAIN, [&](int64_t first, int64_t last) {
        for (int64_t node = first; node < last; ++node) {
            double sum[6] = {};
            for (int32_t k = from[node]; k < from[node + 1]; ++k) {
                double y[3], monomial[TERMS];
                local(frames + 12 * int64_t{rows[k]}, at + 3 * node, y);
                powers(y, 3, monomial);
                const double* term = coefficients + 6 * TERMS * int64_t{rows[k]};
                for (int i = 0; i < TERMS; ++i)
                    for (int c = 0; c < 6; ++c) sum[c] += monomial[i] * term[6 * i + c];
            }
            for (int c = 0; c < 6; ++c) to[6 * node + c] = sum[c] / std::max(from[node + 1] - from[node], 1);
        }
    });
    return out;
}

// ∫ (σ* - σ) S (σ* - σ) dV of each element, with σ* = Σ N_a of nodal values.
Array<double> differences(Numbers nodal, Indices nodes, Numbers N, Numbers stress, Numbers volume, Numbers S) {
    const int64_t m = nodes.shape(0), k = nodes.shape(1), g = N.shape(0);
    require(nodal.ndim() == 2 && nodal.shape(1) == 6, "nodal values must be (n, 6)");
    require(nodes.ndim() == 2 && are_rows(nodes, nodal.shape(0)), "nodes must be rows of nodal values");
    require(has_shape(N, g, k), "N must be (g, k)");
    require(stress.size() == m * g * 6, "stress must be (m, g, 6)");
    require(has_shape(volume, m, g) && has_shape(S, 6, 6), "volume must be (m, g), S (6, 6)");
    Array<double> out(m);
    double* to = out.mutable_data();
    const double *values = nodal.data(), *shape = N.data(), *raw = stress.data(), *dV = volume.data(), *s = S.data();
    const int32_t* rows = nodes.data();
    py::gil_scoped_release release;
    parallel_ranges(m, GRAIN, [&](int64_t first, int64_t last) {
        for (int64_t e = first; e < last; ++e) {
            double total = 0;
            for (int64_t q = 0; q < g; ++q) {
                double off[6], density = 0;
                for (int c = 0; c < 6; ++c) off[c] = -raw[(e * g + q) * 6 + c];
                for (int64_t a = 0; a < k; ++a) {
                    const double weight = shape[q * k + a], *value = values + 6 * int64_t{rows[e * k + a]};
                    for (int c = 0; c < 6; ++c) off[c] += weight * value[c];
                }
                for (int i = 0; i < 6; ++i)
                    for (int j = 0; j < 6; ++j) density += off[i] * s[6 * i + j] * off[j];
                total += density * dV[e * g + q];
            }
            to[e] = total;
        }
    });
    return out;
}

}  // namespace

PYBIND11_MODULE(_recovery, m) {
    common(m);
    define(m, "fit", fitted, "frames (p, 12) and coefficients (p, 20, 6) of the polynomials of patches", "places",
           "values", "offset", "start", "elements", "weights", "degree", "means");
    define(m, "evaluate", evaluated, "mean of some polynomials at each place, (n, 6)", "frame", "terms", "places",
           "start", "patches");
    define(m, "differences", differences, "∫ (σ* - σ) S (σ* - σ) dV (m)", "nodal", "nodes", "N", "stress", "volume",
           "S");
}
