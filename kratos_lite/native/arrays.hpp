// NumPy arrays in and out of the kernels, with one clear error for the wrong shape or an index out of range.

#pragma once
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <optional>
#include <stdexcept>

#include "isa.hpp"
#include "pattern.hpp"
#include "threads.hpp"

namespace kl {

namespace py = pybind11;

// C-contiguous arrays of exactly this type: a kernel never works on a silent copy.
template <class T>
using Array = py::array_t<T, py::array::c_style>;
using Numbers = const Array<double>&;
using Indices = const Array<int32_t>&;
using MaybeNumbers = const std::optional<Array<double>>&;

inline void require(bool condition, const char* what) {
    if (!condition) throw std::invalid_argument(what);
}

inline bool has_shape(Numbers array, int64_t rows, int64_t columns) {
    return array.ndim() == 2 && array.shape(0) == rows && array.shape(1) == columns;
}

// Data of an array (rows, columns), or null of None.
inline const double* optional(MaybeNumbers array, int64_t rows, int64_t columns, const char* what) {
    if (!array) return nullptr;
    require(has_shape(*array, rows, columns), what);
    return array->data();
}

inline bool are_rows(Indices numbers, int64_t n) { return in_range(numbers.data(), numbers.size(), n); }

// Rows that lie within `size` entries.
inline void check_rows(Indices indptr, int64_t size) {
    const int32_t *start = indptr.data(), *end = start + indptr.size();
    require(start < end && start[0] == 0 && std::is_sorted(start, end), "indptr must start with 0 and not fall");
    require(end[-1] == size, "indptr must end with the number of blocks");
}

// A pattern whose rows lie within its indices; an AssemblyMap checks the indices of the rows that it uses.
inline Graph pattern(Indices indptr, Indices indices, int64_t rows) {
    require(indptr.size() == rows + 1, "the pattern must have a row for each point");
    check_rows(indptr, indices.size());
    return {rows, indptr.data(), indices.data()};
}

// A function of a module whose arguments are arrays of exactly the right type, or as given.
inline py::arg argument(const char* name) { return py::arg(name).noconvert(); }
template <class T>
T argument(const T& given) { return given; }

template <class F, class... Arguments>
void define(py::module_& m, const char* name, const F& f, const char* doc, const Arguments&... arguments) {
    m.def(name, f, doc, argument(arguments)...);
}

// Let Python handle signals, as it cannot while a kernel runs.
inline void handle_signals() {
    py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals()) throw py::error_already_set();
}

// What every module of kernels offers.
inline void common(py::module_& m) {
    interruption() = &handle_signals;
    m.def("set_threads", [](int n) { wanted_threads() = n < 1 ? 1 : n; });
    m.def("isa", &isa_name);
}

}  // namespace kl
