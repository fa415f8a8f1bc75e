// Recovery of smooth fields from values at points of elements, and the energy of what they differ by.

#include <algorithm>
#include <vector>

#include "arrays.hpp"
#include "nodal_fields.hpp"
#include "recovery.hpp"
#include "rows.hpp"

namespace {

using namespace kl;

constexpr int64_t GRAIN = 64;  // patches, nodes or elements of one task

void require_rows(Indices start, int64_t size, const char* what) {
    check_rows(start, size);
    require(start.size() > 0, what);
}

auto fitted(Numbers X, Numbers values, Indices offset, Indices start, Indices elements, Numbers weights,
                 Indices degree, Indices means) {
    const int64_t s = X.shape(0), patches = start.size() - 1;
    require(has_shape(X, s, 3) && has_shape(values, s, 6), "places must be (s, 3), values (s, 6)");
    require_rows(offset, s, "offset must be (m + 1)");
    require_rows(start, elements.size(), "start must be (p + 1)");
    require(are_rows(elements, offset.size() - 1), "elements of patches must be rows");
    require(weights.size() == elements.size(), "weights must be those of the elements of the patches");
    require(degree.size() == patches && means.size() == patches, "degree and means must be (p)");
    require(are_rows(degree, 4), "degrees run from 0 to 3");
    const int highest = patches ? *std::max_element(degree.data(), degree.data() + patches) : 0;
    const int most = monomials(highest);
    Array<double> frame({patches, int64_t{12}}), terms({patches, int64_t{most}, int64_t{6}});
    const int64_t m = offset.size() - 1;
    std::vector<double> summary(SUMMARY * m);
    const Fit fit{X.data(),      values.data(), offset.data(),  start.data(),         elements.data(),      weights.data(),
                  degree.data(), means.data(),  summary.data(), frame.mutable_data(), terms.mutable_data(), most};
    {
        GilReleased release;
        parallel_ranges(m, 8 * GRAIN, [&](int64_t first, int64_t last) {
            for (int64_t e = first; e < last; ++e) summarize(fit, e, summary.data() + SUMMARY * e);
        });
        parallel_ranges(patches, GRAIN, [&](int64_t first, int64_t last) { fit_patches({&fit, first, last}); });
    }
    return std::make_tuple(frame, terms);
}

Array<double> evaluated(Numbers frame, Numbers terms, Numbers X, Indices start, Indices patches) {
    const int64_t n = X.shape(0), p = frame.shape(0);
    require(has_shape(frame, p, 12), "frame must be (p, 12)");
    require(terms.ndim() == 3 && terms.shape(0) == p && terms.shape(2) == 6, "terms must be (p, t, 6)");
    const int count = static_cast<int>(terms.shape(1)), degree = degree_of(count);
    require(count == monomials(degree), "terms must be all up to a degree");
    require(has_shape(X, n, 3) && start.size() == n + 1, "places must be (n, 3), start (n + 1)");
    require_rows(start, patches.size(), "start must be (n + 1)");
    require(are_rows(patches, p), "patches must be rows of the fits");
    Array<double> out({static_cast<int64_t>(n), int64_t{6}});
    double* to = out.mutable_data();
    const double *at = X.data(), *frames = frame.data(), *coefficients = terms.data();
    const int32_t *from = start.data(), *rows = patches.data();
    GilReleased release;
    parallel_ranges(n, 8 * GRAIN, [&](int64_t first, int64_t last) {
        for (int64_t node = first; node < last; ++node) {
            double sum[6] = {};
            for (int32_t k = from[node]; k < from[node + 1]; ++k) {
                double y[3], monomial[TERMS];
                local(frames + 12 * int64_t{rows[k]}, at + 3 * node, y);
                powers(y, degree, monomial);
                const double* term = coefficients + 6 * count * int64_t{rows[k]};
                for (int i = 0; i < count; ++i)
                    for (int c = 0; c < 6; ++c) sum[c] += monomial[i] * term[6 * i + c];
            }
            for (int c = 0; c < 6; ++c) to[6 * node + c] = sum[c] / std::max(from[node + 1] - from[node], 1);
        }
    });
    return out;
}

// E (values - mean of some polynomials) at the nodes of each element, from points in it: (m, k, 6).
Array<double> residuals(Numbers frame, Numbers terms, Numbers X, Numbers values, Numbers E, Indices nodes,
                        Indices start, Indices patches) {
    const int64_t m = nodes.shape(0), k = nodes.shape(1), s = E.shape(1), p = frame.shape(0);
    require(has_shape(frame, p, 12), "frame must be (p, 12)");
    require(terms.ndim() == 3 && terms.shape(0) == p && terms.shape(2) == 6, "terms must be (p, t, 6)");
    const int count = static_cast<int>(terms.shape(1)), degree = degree_of(count);
    require(count == monomials(degree), "terms must be all up to a degree");
    require(X.size() == m * s * 3 && values.size() == m * s * 6, "places must be (m, s, 3), values (m, s, 6)");
    require(has_shape(E, k, s), "E must be (k, s)");
    require_rows(start, patches.size(), "start must be (n + 1)");
    require(are_rows(nodes, start.size() - 1), "nodes must be rows of start");
    require(are_rows(patches, p), "patches must be rows of the fits");
    Array<double> out({m, k, int64_t{6}});
    const Residuals every{frame.data(), terms.data(), X.data(),     values.data(),  E.data(),           nodes.data(),
                          start.data(), patches.data(), count, degree, k, s, out.mutable_data(), 0, m};
    GilReleased release;
    parallel_ranges(m, GRAIN, [&](int64_t first, int64_t last) {
        Residuals task = every;
        task.first = first;
        task.last = last;
        leave(task);
    });
    return out;
}

// Rows of values combined by a table: (m, s, c).
Array<double> combined(Numbers table, Numbers values, Indices rows) {
    require(table.ndim() == 2 && rows.ndim() == 2 && rows.shape(1) == table.shape(1), "rows must be (m, k)");
    require(values.ndim() == 2, "values must be (n, c)");
    const int64_t m = rows.shape(0), s = table.shape(0), c = values.shape(1);
    require(c == 3 || c == 6, "values must have three or six components");
    require(are_rows(rows, values.shape(0)), "rows must be those of the values");
    Array<double> out({m, s, c});
    const Combination every{table.data(), values.data(), rows.data(), s, rows.shape(1), out.mutable_data(), 0, m};
    GilReleased release;
    parallel_ranges(m, 4 * GRAIN, [&](int64_t first, int64_t last) {
        Combination task = every;
        task.first = first;
        task.last = last;
        c == 3 ? combine_3(task) : combine_6(task);
    });
    return out;
}

// Sums at nodes of values (m, k, 6) of elements.
Array<double> summed(Numbers values, Indices nodes, int64_t n) {
    require(n >= 0 && are_rows(nodes, n), "nodes must be rows");
    require(values.size() == 6 * nodes.size(), "values must be (m, k, 6)");
    Array<double> total({n, int64_t{6}});
    double* to = total.mutable_data();
    const double* from = values.data();
    const int32_t* rows = nodes.data();
    GilReleased release;
    std::fill_n(to, 6 * n, 0.0);
    for (int64_t a = 0; a < nodes.size(); ++a)
        for (int c = 0; c < 6; ++c) to[6 * int64_t{rows[a]} + c] += from[6 * a + c];
    return total;
}

// ∫ (σ* - σ) S (σ*' - σ') dV of each element, with σ* = Σ N_a of nodal values.
Array<double> multiplied(Numbers nodal, Numbers raw, Numbers others, Numbers other_raw, Indices nodes, Numbers N,
                         Numbers dV, Numbers S) {
    const int64_t n = nodal.shape(0), m = nodes.shape(0), k = nodes.shape(1), g = N.shape(0);
    require(has_shape(nodal, n, 6) && has_shape(others, n, 6), "nodal values must be (n, 6)");
    require(nodes.ndim() == 2 && are_rows(nodes, n), "nodes must be rows of nodal values");
    require(has_shape(N, g, k), "N must be (g, k)");
    require(raw.size() == m * g * 6 && other_raw.size() == m * g * 6, "stresses must be (m, g, 6)");
    require(has_shape(dV, m, g) && has_shape(S, 6, 6), "volumes must be (m, g), S (6, 6)");
    Array<double> out(m);
    const Differences every{nodal.data(), raw.data(), others.data(), other_raw.data(), nodes.data(), N.data(),
                            dV.data(),    S.data(),   k,             g,                out.mutable_data(), 0, m};
    GilReleased release;
    parallel_ranges(m, 4 * GRAIN, [&](int64_t first, int64_t last) {
        Differences task = every;
        task.first = first;
        task.last = last;
        products(task);
    });
    return out;
}

using Integers = const Array<int64_t>&;

void require_members(Integers numbers, int64_t n, const char* what) {
    const int64_t* number = numbers.data();
    bool inside = true;
    for (int64_t i = 0; i < numbers.size(); ++i) inside &= 0 <= number[i] && number[i] < n;
    require(inside, what);
}

Array<int64_t> copied(const std::vector<int64_t>& numbers) { return Array<int64_t>(numbers); }

auto dealt(Integers owner, Integers entries, int64_t n) {
    require(n >= 0 && owner.size() == entries.size(), "each entry must have an owner");
    require_members(owner, n, "owners must be rows");
    Array<int64_t> start(n + 1), out(entries.size());
    deal(owner.data(), entries.data(), owner.size(), n, start.mutable_data(), out.mutable_data());
    return std::make_tuple(start, out);
}

auto distinct(Integers owner, Integers entries, int64_t n) {
    auto [start, all] = dealt(owner, entries, n);
    Distinct found;
    int64_t* each = all.mutable_data();
    {
        GilReleased release;
        found.find(start.data(), each, n);
    }
    return std::make_tuple(copied(found.owner), copied(found.entries), copied(found.count));
}

void require_rises(Integers start, int64_t size) {
    const int64_t n = start.size() - 1, *from = start.data();
    require(n >= 0 && from[0] == 0 && std::is_sorted(from, from + n + 1) && from[n] == size,
            "start must rise from 0 to the number of entries");
}

auto grown(Integers owner, Integers cells, Integers corners, Integers from, Integers around, int64_t n) {
    require(corners.ndim() == 2, "corners must be (m, c)");
    const int64_t m = corners.shape(0), nodes = from.size() - 1;
    const auto [start, mine] = dealt(owner, cells, n);
    require_members(mine, m, "cells must be there");
    require_rises(from, around.size());
    require_members(around, m, "cells around corners must be there");
    for (int64_t i = 0; i < corners.size(); ++i) require(corners.data()[i] < nodes, "corners must be nodes");
    Grown found;
    {
        GilReleased release;
        found.grow(start.data(), mine.data(), n, corners.data(), m, corners.shape(1), from.data(), around.data(), nodes);
    }
    return std::make_tuple(copied(found.owner), copied(found.entries));
}

auto taken(Integers start, Integers entries, Integers rows) {
    const int64_t n = start.size() - 1, *from = start.data();
    require_rises(start, entries.size());
    require_members(rows, n, "rows must be there");
    Array<int64_t> first(rows.size() + 1);
    int64_t* to = first.mutable_data();
    to[0] = 0;
    for (int64_t i = 0; i < rows.size(); ++i) to[i + 1] = to[i] + from[rows.data()[i] + 1] - from[rows.data()[i]];
    Array<int64_t> out(to[rows.size()]);
    for (int64_t i = 0; i < rows.size(); ++i)
        std::copy_n(entries.data() + from[rows.data()[i]], to[i + 1] - to[i], out.mutable_data() + to[i]);
    return std::make_tuple(first, out);
}

}  // namespace

KL_MODULE(_recovery, m) {
    define<&fitted>(m, "fit", "frames (p, 12) and coefficients (p, t, 6) of the polynomials of patches",
                    {"places", "values", "offset", "start", "elements", "weights", "degree", "means"});
    define<&evaluated>(m, "evaluate", "mean of some polynomials at each place, (n, 6)",
                       {"frame", "terms", "places", "start", "patches"});
    define<&residuals>(m, "residuals", "E (values - mean of some polynomials) (m, k, 6)",
                       {"frame", "terms", "places", "values", "E", "nodes", "start", "patches"});
    define<&dealt>(m, "dealt", "start (n + 1) and entries of n rows, by their owners", {"owner", "entries", "n"});
    define<&distinct>(m, "distinct", "owner, entry and count of the distinct entries of n rows",
                      {"owner", "entries", "n"});
    define<&grown>(m, "grown", "owner and cell of rows of cells with those around their corners",
                   {"owner", "cells", "corners", "start", "around", "n"});
    define<&taken>(m, "taken", "some of the rows", {"start", "entries", "rows"});
    define<&combined>(m, "combined", "rows of values combined by a table, (m, s, c)", {"table", "values", "rows"});
    define<&summed>(m, "summed", "sums at n nodes of values (m, k, 6) of elements", {"values", "nodes", "n"});
    define<&multiplied>(m, "products", "∫ (σ* - σ) S (σ*' - σ') dV (m)",
                        {"nodal", "raw", "others", "other_raw", "nodes", "N", "dV", "S"});
}
