// NumPy arrays in and out of the kernels, with one clear error for the wrong shape.

#pragma once
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <algorithm>
#include <stdexcept>
#include <string>

#include "isa.hpp"
#include "threads.hpp"

namespace kl {

namespace py = pybind11;

// C-contiguous arrays of exactly this type: a kernel never works on a silent copy.
template <class T>
using Array = py::array_t<T, py::array::c_style>;
using Numbers = const Array<double>&;
using Indices = const Array<int32_t>&;

inline void require(bool condition, const char* what) {
    if (!condition) throw std::invalid_argument(what);
}

inline bool has_shape(Numbers array, int64_t rows, int64_t columns) {
    return array.ndim() == 2 && array.shape(0) == rows && array.shape(1) == columns;
}

// Whether all are rows of something with n of them.
inline bool are_rows(Indices numbers, int64_t n) {
    int32_t low = 0, high = -1;
    for (int64_t i = 0; i < numbers.size(); ++i) {
        low = std::min(low, numbers.data()[i]);
        high = std::max(high, numbers.data()[i]);
    }
    return low >= 0 && high < n;
}

// What every module of kernels offers.
inline void common(py::module_& m) {
    m.def("set_threads", [](int n) { wanted_threads() = n < 1 ? 1 : n; });
    m.def("isa", &isa_name);
}

}  // namespace kl
