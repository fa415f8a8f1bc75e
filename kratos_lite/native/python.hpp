// Python's objects, and functions and classes for Python, by its C interface alone.
//
// Only what the kernels need: headers of a complete binding library take longer to compile than most kernels.
//
//     KL_MODULE(_name, m) {
//         define<&f>(m, "f", "what it does", {"points", "nodes"});
//         add_class<C>(m, "C", {method<&C::g>("g")});
//     }
//
// Arguments are converted by Given<T>, what is returned by returned(value).  Exceptions become Python's.

#pragma once
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <cstdint>
#include <initializer_list>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace kl {

// Python has an error set, which its caller is to see.
struct PythonError {};

// An argument that is not of the type expected.
struct Mismatch {
    std::string expected;
};

// A reference to an object; made, copied and given up while the GIL is held.
class Object {
public:
    Object() = default;
    static Object of(PyObject* made) {
        if (!made) throw PythonError{};
        Object out;
        out.to = made;
        return out;
    }
    static Object borrowed(PyObject* other) {
        Py_XINCREF(other);
        Object out;
        out.to = other;
        return out;
    }
    Object(const Object& other) : to(other.to) { Py_XINCREF(to); }
    Object(Object&& other) noexcept : to(std::exchange(other.to, nullptr)) {}
    Object& operator=(Object other) noexcept {
        std::swap(to, other.to);
        return *this;
    }
    ~Object() { Py_XDECREF(to); }

    PyObject* get() const { return to; }
    PyObject* release() { return std::exchange(to, nullptr); }
    bool is_none() const { return to == Py_None; }
    Object attribute(const char* name) const { return of(PyObject_GetAttrString(to, name)); }
    // Call it with one number.
    Object operator()(double x) const { return of(PyObject_CallFunction(to, "d", x)); }

private:
    PyObject* to = nullptr;
};

struct GilReleased {
    PyThreadState* state = PyEval_SaveThread();
    GilReleased() = default;
    GilReleased(const GilReleased&) = delete;
    ~GilReleased() { PyEval_RestoreThread(state); }
};

// What f() returns, which needs nothing of Python.
template <class F>
auto without_gil(const F& f) {
    GilReleased release;
    return f();
}

struct GilHeld {
    PyGILState_STATE state = PyGILState_Ensure();
    GilHeld() = default;
    GilHeld(const GilHeld&) = delete;
    ~GilHeld() { PyGILState_Release(state); }
};

// The class of Python that holds objects of a class of C++.
template <class C>
inline PyTypeObject* type_of = nullptr;

template <class C>
struct Instance {
    PyObject_HEAD
    std::shared_ptr<C> held;
};

// Arguments --------------------------------------------------------------------------------------------------

template <class T, class = void>
struct Given;

template <class T>
struct Given<T, std::enable_if_t<std::is_floating_point_v<T>>> {
    static T of(PyObject* given) {
        const double x = PyFloat_AsDouble(given);
        if (x == -1 && PyErr_Occurred()) throw Mismatch{"a number"};
        return static_cast<T>(x);
    }
};

template <class T>
struct Given<T, std::enable_if_t<std::is_integral_v<T>>> {
    static T of(PyObject* given) {
        const long long n = PyLong_AsLongLong(given);
        if (n == -1 && PyErr_Occurred()) throw Mismatch{"an integer"};
        if (n < std::numeric_limits<T>::min() || n > std::numeric_limits<T>::max()) throw Mismatch{"a smaller integer"};
        return static_cast<T>(n);
    }
};

template <>
struct Given<bool> {
    static bool of(PyObject* given) {
        const int truth = PyObject_IsTrue(given);
        if (truth < 0) throw Mismatch{"True or False"};
        return truth;
    }
};

template <>
struct Given<std::string> {
    static std::string of(PyObject* given) {
        const char* text = PyUnicode_Check(given) ? PyUnicode_AsUTF8(given) : nullptr;
        if (!text) throw Mismatch{"text"};
        return text;
    }
};

template <>
struct Given<Object> {
    static Object of(PyObject* given) { return Object::borrowed(given); }
};

template <class T>
struct Given<std::optional<T>> {
    static std::optional<T> of(PyObject* given) {
        if (given == Py_None) return {};
        return Given<T>::of(given);
    }
};

// The elements of a tuple or list of a size, or of any.
inline PyObject** elements_of(PyObject* given, Py_ssize_t size = -1) {
    const bool right = PyTuple_Check(given) || PyList_Check(given);
    if (!right || (size >= 0 && PySequence_Fast_GET_SIZE(given) != size))
        throw Mismatch{size < 0 ? "a list" : "a tuple of " + std::to_string(size)};
    return PySequence_Fast_ITEMS(given);
}

template <class... T>
struct Given<std::tuple<T...>> {
    static std::tuple<T...> of(PyObject* given) {
        return of(elements_of(given, sizeof...(T)), std::index_sequence_for<T...>());
    }
    template <size_t... I>
    static std::tuple<T...> of(PyObject** each, std::index_sequence<I...>) {
        return std::tuple<T...>{Given<T>::of(each[I])...};
    }
};

template <class T>
struct Given<std::vector<T>> {
    static std::vector<T> of(PyObject* given) {
        PyObject** each = elements_of(given);
        std::vector<T> out;
        for (Py_ssize_t i = 0; i < PySequence_Fast_GET_SIZE(given); ++i) out.push_back(Given<T>::of(each[i]));
        return out;
    }
};

template <class C>
bool is_instance(PyObject* given) { return Py_TYPE(given) == type_of<C>; }

template <class C>
const std::shared_ptr<C>& held(PyObject* instance) { return reinterpret_cast<Instance<C>*>(instance)->held; }

template <class C>
struct Given<std::shared_ptr<C>> {
    static std::shared_ptr<C> of(PyObject* given) {
        if (!is_instance<C>(given)) throw Mismatch{std::string("a ") + type_of<C>->tp_name};
        return held<C>(given);
    }
};

// What is returned: new references --------------------------------------------------------------------------

inline PyObject* returned(Object value) { return value.release(); }
inline PyObject* returned(double value) { return PyFloat_FromDouble(value); }
inline PyObject* returned(bool value) { return PyBool_FromLong(value); }
inline PyObject* returned(const char* value) { return PyUnicode_FromString(value); }
template <class T>
std::enable_if_t<std::is_integral_v<T>, PyObject*> returned(T value) { return PyLong_FromLongLong(value); }

template <class T>
PyObject* returned(const std::vector<T>& values) {
    Object out = Object::of(PyList_New(static_cast<Py_ssize_t>(values.size())));
    for (size_t i = 0; i < values.size(); ++i)
        PyList_SET_ITEM(out.get(), i, Object::of(returned(values[i])).release());
    return out.release();
}

template <class T>
PyObject* returned(std::optional<T> value) {
    if (value) return returned(std::move(*value));
    Py_RETURN_NONE;
}

template <class... T>
PyObject* returned(std::tuple<T...> values) {
    Object out = Object::of(PyTuple_New(sizeof...(T)));
    std::apply([&, i = Py_ssize_t{0}](auto&... value) mutable {
        (PyTuple_SET_ITEM(out.get(), i++, Object::of(returned(std::move(value))).release()), ...);
    }, values);
    return out.release();
}

template <class C>
PyObject* returned(std::shared_ptr<C> held) {
    auto* out = PyObject_New(Instance<C>, type_of<C>);
    if (out) new (&out->held) std::shared_ptr<C>(std::move(held));
    return reinterpret_cast<PyObject*>(out);
}

// Functions -------------------------------------------------------------------------------------------------

struct Parameter {
    const char* name;
    PyObject* otherwise;  // what is taken where nothing is given, or null; it lives as long as the process

    Parameter(const char* name, PyObject* otherwise = nullptr) : name(name), otherwise(otherwise) {}
};

struct Signature {
    const char* name = nullptr;
    std::vector<Parameter> parameters;  // those that have names
    PyMethodDef definition{};

    // The error names the type of what was given, if anything was.
    [[noreturn]] void refuse(const std::string& what, PyObject* given = nullptr) const {
        PyErr_Format(PyExc_TypeError, "%s(): %s%s", name, what.c_str(), given ? Py_TYPE(given)->tp_name : "");
        throw PythonError{};
    }

    std::string of(size_t i) const {
        return i < parameters.size() ? parameters[i].name : "argument " + std::to_string(i + 1);
    }

    // Arguments by position and by name, in the order of the parameters.
    void sort(PyObject* const* arguments, Py_ssize_t positions, PyObject* names, PyObject** given, size_t count) const {
        if (positions > static_cast<Py_ssize_t>(count)) refuse("too many arguments");
        for (size_t i = 0; i < count; ++i) given[i] = static_cast<Py_ssize_t>(i) < positions ? arguments[i] : nullptr;
        for (Py_ssize_t k = 0; names && k < PyTuple_GET_SIZE(names); ++k) {
            PyObject* name = PyTuple_GET_ITEM(names, k);
            size_t i = 0;
            while (i < parameters.size() && PyUnicode_CompareWithASCIIString(name, parameters[i].name)) ++i;
            if (i == parameters.size() || given[i]) refuse("unknown or repeated name of an argument");
            given[i] = arguments[positions + k];
        }
        for (size_t i = 0; i < count; ++i) {
            if (!given[i] && i < parameters.size()) given[i] = parameters[i].otherwise;
            if (!given[i]) refuse(of(i) + " is missing");
        }
    }

    template <class T>
    __attribute__((noinline)) T converted(PyObject* given, size_t i) const {
        try {
            return Given<T>::of(given);
        } catch (const Mismatch& mismatch) {
            PyErr_Clear();
            refuse(of(i) + " must be " + mismatch.expected + ", not ", given);
        }
    }
};

template <auto F>
inline Signature signature{};

// Set Python's error for the exception that is being handled.
inline void set_error() {
    try {
        throw;
    } catch (const PythonError&) {
    } catch (const std::invalid_argument& error) {
        PyErr_SetString(PyExc_ValueError, error.what());
    } catch (const std::overflow_error& error) {
        PyErr_SetString(PyExc_OverflowError, error.what());
    } catch (const std::bad_alloc&) {
        PyErr_NoMemory();
    } catch (const std::length_error&) {
        PyErr_NoMemory();
    } catch (const std::exception& error) {
        PyErr_SetString(PyExc_RuntimeError, error.what());
    } catch (...) {
        PyErr_SetString(PyExc_RuntimeError, "unknown error in a compiled kernel");
    }
}

template <auto F, class Type = decltype(F)>
struct Call;

template <auto F, class R, class... A>
struct Call<F, R (*)(A...)> {
    static constexpr size_t count = sizeof...(A);
    using Values = std::tuple<std::decay_t<A>...>;
    template <size_t... I>
    static R with(PyObject*, Values& values, std::index_sequence<I...>) {
        return F(static_cast<A&&>(std::get<I>(values))...);
    }
};

template <auto F, class C, class R, class... A>
struct Call<F, R (C::*)(A...)> {
    static constexpr size_t count = sizeof...(A);
    using Values = std::tuple<std::decay_t<A>...>;
    template <size_t... I>
    static R with(PyObject* self, Values& values, std::index_sequence<I...>) {
        return (held<C>(self).get()->*F)(static_cast<A&&>(std::get<I>(values))...);
    }
};

template <auto F, class C, class R, class... A>
struct Call<F, R (C::*)(A...) const> : Call<F, R (C::*)(A...)> {};

template <class Values, size_t... I>
Values converted(const Signature& s, PyObject** given, std::index_sequence<I...>) {
    return Values{s.converted<std::tuple_element_t<I, Values>>(given[I], I)...};
}

// F as Python calls it.
template <auto F>
PyObject* called(PyObject* self, PyObject* const* arguments, Py_ssize_t positions, PyObject* names) {
    constexpr size_t count = Call<F>::count;
    const std::make_index_sequence<count> all;
    try {
        PyObject* given[count + 1];
        signature<F>.sort(arguments, positions, names, given, count);
        auto values = converted<typename Call<F>::Values>(signature<F>, given, all);
        if constexpr (std::is_void_v<decltype(Call<F>::with(self, values, all))>) {
            Call<F>::with(self, values, all);
            Py_RETURN_NONE;
        } else {
            return returned(Call<F>::with(self, values, all));
        }
    } catch (...) {
        set_error();
        return nullptr;
    }
}

template <auto F>
PyMethodDef method(const char* name, const char* doc = nullptr, const std::vector<Parameter>& parameters = {}) {
    const auto call = reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(&called<F>));
    signature<F> = {name, parameters, {name, call, METH_FASTCALL | METH_KEYWORDS, doc}};
    return signature<F>.definition;
}

template <auto F>
void define(const Object& m, const char* name, const char* doc, const std::vector<Parameter>& parameters) {
    method<F>(name, doc, parameters);
    Object made = Object::of(PyCFunction_NewEx(&signature<F>.definition, nullptr, m.attribute("__name__").get()));
    if (PyModule_AddObject(m.get(), name, made.get())) throw PythonError{};
    made.release();
}

// A function that makes an object of a class.
template <class C, class... A>
std::shared_ptr<C> make(A... arguments) { return std::make_shared<C>(std::move(arguments)...); }

// A class whose objects functions return.
template <class C>
void add_class(const char* name, std::initializer_list<PyMethodDef> methods) {
    static std::vector<PyMethodDef> all;
    all.assign(methods);
    all.push_back({});
    const auto dealloc = [](PyObject* self) {
        PyTypeObject* type = Py_TYPE(self);
        reinterpret_cast<Instance<C>*>(self)->held.~shared_ptr();
        PyObject_Free(self);
        Py_DECREF(type);
    };
    PyType_Slot slots[] = {{Py_tp_dealloc, reinterpret_cast<void*>(+dealloc)}, {Py_tp_methods, all.data()}, {0, nullptr}};
    PyType_Spec spec{name, sizeof(Instance<C>), 0, Py_TPFLAGS_DEFAULT | Py_TPFLAGS_DISALLOW_INSTANTIATION, slots};
    type_of<C> = reinterpret_cast<PyTypeObject*>(Object::of(PyType_FromSpec(&spec)).release());
}

}  // namespace kl
