// NumPy arrays in and out of the kernels, with one clear error for the wrong shape or an index out of range.

#pragma once
#include "python.hpp"

#include <algorithm>
#include <cstring>

#include "isa.hpp"
#include "pattern.hpp"
#include "threads.hpp"

namespace kl {

inline void require(bool condition, const char* what) {
    if (!condition) throw std::invalid_argument(what);
}

template <class T>
constexpr const char* DTYPE = nullptr;
template <>
inline constexpr const char* DTYPE<double> = "float64";
template <>
inline constexpr const char* DTYPE<float> = "float32";
template <>
inline constexpr const char* DTYPE<int64_t> = "int64";
template <>
inline constexpr const char* DTYPE<int32_t> = "int32";
template <>
inline constexpr const char* DTYPE<uint8_t> = "uint8";

// What is needed of NumPy; alive as long as the process.
struct NumPy {
    PyTypeObject* ndarray = nullptr;
    PyObject* empty = nullptr;
    template <class T>
    inline static PyObject* dtype = nullptr;

    static NumPy& get() {
        static NumPy found;
        return found;
    }

    static void import() {
        const Object numpy = Object::of(PyImport_ImportModule("numpy"));
        get().ndarray = reinterpret_cast<PyTypeObject*>(numpy.attribute("ndarray").release());
        get().empty = numpy.attribute("empty").release();
        const Object dtype = numpy.attribute("dtype");
        add<double>(dtype), add<float>(dtype), add<int64_t>(dtype), add<int32_t>(dtype), add<uint8_t>(dtype);
    }

private:
    template <class T>
    static void add(const Object& type) {
        dtype<T> = Object::of(PyObject_CallFunction(type.get(), "s", DTYPE<T>)).release();
    }
};

// C-contiguous arrays of exactly this type: a kernel never works on a silent copy.
template <class T>
class Array {
public:
    Array() = default;
    explicit Array(Object array) : array(std::move(array)) {}
    Array(std::initializer_list<int64_t> shape) : Array(made(shape.begin(), shape.size())) {}
    explicit Array(int64_t n) : Array({n}) {}
    explicit Array(const std::vector<T>& numbers) : Array(static_cast<int64_t>(numbers.size())) {
        std::copy(numbers.begin(), numbers.end(), mutable_data());
    }

    static bool is(PyObject* given) {
        if (!PyObject_TypeCheck(given, NumPy::get().ndarray)) return false;
        const Fields* fields = reinterpret_cast<const Fields*>(given);
        PyObject* mine = NumPy::dtype<T>;
        return (fields->flags & RIGHT) == RIGHT &&
               (fields->dtype == mine || PyObject_RichCompareBool(fields->dtype, mine, Py_EQ) == 1);
    }

    int ndim() const { return fields()->ndim; }
    int64_t shape(int axis) const {
        require(axis < ndim(), "an array has too few axes");
        return fields()->shape[axis];
    }
    int64_t size() const {
        if (!array.get()) return 0;
        int64_t all = 1;
        for (int i = 0; i < ndim(); ++i) all *= fields()->shape[i];
        return all;
    }
    const T* data() const { return array.get() ? reinterpret_cast<const T*>(fields()->data) : nullptr; }
    bool writeable() const { return fields()->flags & WRITEABLE; }
    T* mutable_data() {
        require(writeable(), "array is not writeable");
        return reinterpret_cast<T*>(fields()->data);
    }
    std::vector<T> copy() const { return {data(), data() + size()}; }
    T at(int64_t row, int64_t column) const { return data()[row * shape(1) + column]; }
    const Object& object() const { return array; }

private:
    // The fields of every NumPy array, which its binary interface fixes.
    struct Fields {
        PyObject_HEAD
        char* data;
        int ndim;
        Py_ssize_t *shape, *strides;
        PyObject *base, *dtype;
        int flags;
    };
    enum Flag { CONTIGUOUS = 0x1, ALIGNED = 0x100, RIGHT = CONTIGUOUS | ALIGNED, WRITEABLE = 0x400 };
    Fields* fields() const { return reinterpret_cast<Fields*>(array.get()); }

    static Object made(const int64_t* shape, size_t axes) {
        const Object sizes = Object::of(PyTuple_New(static_cast<Py_ssize_t>(axes)));
        for (size_t i = 0; i < axes; ++i)
            PyTuple_SET_ITEM(sizes.get(), i, Object::of(PyLong_FromLongLong(shape[i])).release());
        return Object::of(PyObject_CallFunctionObjArgs(NumPy::get().empty, sizes.get(), NumPy::dtype<T>, nullptr));
    }

    Object array;
};

template <class T>
struct Given<Array<T>> {
    static Array<T> of(PyObject* given) {
        if (!Array<T>::is(given)) throw Mismatch{std::string("a C-contiguous, aligned array of ") + DTYPE<T>};
        return Array<T>(Object::borrowed(given));
    }
};

template <class T>
PyObject* returned(const Array<T>& array) { return Object(array.object()).release(); }

using Numbers = const Array<double>&;
using Indices = const Array<int32_t>&;
using MaybeNumbers = const std::optional<Array<double>>&;

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

// Let Python handle signals, as it cannot while a kernel runs.
inline void handle_signals() {
    GilHeld held;
    if (PyErr_Occurred() || PyErr_CheckSignals()) throw PythonError{};
}

constexpr const char* POOL = "kratos_lite.native._threads.pool";

// The pool of the module _threads.
inline Threads* pool() {
    const Object module = Object::of(PyImport_ImportModule("kratos_lite.native._threads"));
    return static_cast<Threads*>(PyCapsule_GetPointer(module.attribute("pool").get(), POOL));
}

// A module with what every one of them offers, and with what `fill` adds; null with Python's error set.
inline PyObject* made_module(PyModuleDef& definition, void (*fill)(const Object&)) {
    try {
        NumPy::import();
        if (isa_wanted() < isa()) {
            PyErr_Format(PyExc_ImportError, "built for %s alone, as KRATOS_LITE_BUILD was not 'compiled'", isa_name());
            throw PythonError{};
        }
        Object m = Object::of(PyModule_Create(&definition));
        interruption() = &handle_signals;
        if (!threads()) threads() = pool();
        define<&isa_name>(m, "isa", "the instruction set that kernels use", {});
        fill(m);
        return m.release();
    } catch (...) {
        set_error();
        return nullptr;
    }
}

}  // namespace kl

#define KL_MODULE(name, m) \
    static void fill_##name(const kl::Object&); \
    PyMODINIT_FUNC PyInit_##name() { \
        static PyModuleDef definition{PyModuleDef_HEAD_INIT, #name, nullptr, -1, nullptr, nullptr, nullptr, nullptr, nullptr}; \
        return kl::made_module(definition, fill_##name); \
    } \
    static void fill_##name([[maybe_unused]] const kl::Object& m)
