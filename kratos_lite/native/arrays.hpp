// NumPy arrays in and out of the kernels, with one clear error for the wrong shape.

#pragma once
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <stdexcept>
#include <string>

#include "isa.hpp"
#include "threads.hpp"

namespace kl {

namespace py = pybind11;

// C-contiguous arrays of exactly this type: a kernel never works on a silent copy.
template <class T>
using Array = py::array_t<T, py::array::c_style>;

inline void require(bool condition, const char* what) {
    if (!condition) throw std::invalid_argument(what);
}

// What every module of kernels offers.
inline void common(py::module_& m) {
    m.def("set_threads", [](int n) { wanted_threads() = n < 1 ? 1 : n; });
    m.def("isa", &isa_name);
}

}  // namespace kl
