// Steps of many rigid or pseudo-rigid bodies, in place.
//
// Arrays hold N bodies with any leading axes.  What a body is made of (inertia, mass …) and constant loads may
// also be given once for all.  Bodies do not meet, so tasks of any size give the same numbers.

#include <algorithm>
#include <mutex>
#include <utility>

#include "arrays.hpp"
#include "pseudo_rigid.hpp"

namespace {

using kl::gather;
using kl::LANES;
using kl::PseudoGroup;
using kl::require;
using kl::RigidGroup;
using kl::Rows;
using kl::scatter;
namespace py = pybind11;

using Floats = const py::array&;

constexpr int64_t GRAIN = 1024;  // steps of a body in one task

// The numbers of an array; casting each argument to Array<double> would take longer than the step of one body.
const double* numbers(Floats array) {
    static const py::handle floats = py::dtype::of<double>().release();
    const auto* proxy = py::detail::array_proxy(array.ptr());
    const bool right = proxy->descr == floats.ptr() || py::isinstance<py::array_t<double>>(array);
    if (!right || !(proxy->flags & py::array::c_style)) throw py::type_error("arrays must be C-contiguous float64");
    return reinterpret_cast<const double*>(proxy->data);
}

int64_t bodies(Floats q, int width, const char* what) {
    require(q.ndim() > 0 && q.shape(q.ndim() - 1) == width, what);
    return q.size() / width;
}

double* state(Floats array, int64_t n, int width, const char* what) {
    require(array.size() == n * width, what);
    require(array.writeable(), "a read-only array cannot be advanced in place");
    return const_cast<double*>(numbers(array));
}

// For each body, or one for all.
Rows rows(Floats array, int64_t n, int width, const char* what) {
    const int64_t size = array.size();
    require(size == n * width || size == width, what);
    return {numbers(array), size == width ? 0 : width, width};
}

double* optional_state(const py::object& array, int64_t n, const char* what) {
    if (array.is_none()) return nullptr;
    require(py::isinstance<py::array>(array), what);
    return state(py::reinterpret_borrow<py::array>(array), n, 1, what);
}

// The first body that failed and its step, or -1 twice.
class Failure {
public:
    void note(int64_t body, int64_t step) {
        std::lock_guard<std::mutex> lock(mutex);
        if (first.first < 0 || body < first.first) first = {body, step};
    }
    std::pair<int64_t, int64_t> first{-1, -1};

private:
    std::mutex mutex;
};

// Whether a body of a group failed in a step; the first one that did is noted.
template <class Group>
bool noted(const Group& g, int64_t first, int64_t step, Failure& failure) {
    for (int l = 0; l < g.count; ++l) {
        if (g.flaw[0][l] == 0) continue;
        failure.note(first + l, step);
        return true;
    }
    return false;
}

// f(first, count) for groups of bodies, on all threads where there are enough of them.  A group goes through all
// its steps while it is in the cache.
template <class F>
void groups(int64_t n, int64_t steps, const F& f) {
    const int64_t few = std::max<int64_t>(1, GRAIN / std::max<int64_t>(1, steps));
    kl::parallel_ranges(n, (few + LANES - 1) / LANES * LANES, [&](int64_t first, int64_t last) {
        for (; first < last; first += LANES) f(first, static_cast<int>(std::min<int64_t>(LANES, last - first)));
    });
}

// A kernel, never inlined: elsewhere the compiler might join its products and sums in another way, and one step
// would no longer be one of many to the bit.
template <auto KERNEL, class Group>
__attribute__((noinline)) void run(Group& g) {
    KERNEL(g);
}

struct RigidBodies {
    double *q, *u;
    Rows inertia, inverse, mass;
    double h, tolerance;
    int scheme;

    void gather_to(RigidGroup& g, int64_t first, int count) const {
        g.h = h;
        g.tolerance = tolerance;
        g.scheme = scheme;
        g.count = count;
        gather({q, 12, 12}, first, count, g.q);
        gather({u, 6, 6}, first, count, g.u);
        gather(inertia, first, count, g.inertia);
        gather(inverse, first, count, g.inverse);
        gather(mass, first, count, g.mass);
        std::fill(*g.work, *g.work + LANES, 0.0);
    }
    void scatter_from(const RigidGroup& g, int64_t first, int count) const {
        scatter(g.q, 12, first, count, q);
        scatter(g.u, 6, first, count, u);
    }
};

void rigid_half(Floats q, Floats u, double h, Floats out) {
    const int64_t n = bodies(q, 12, "q must be (N, 12)");
    const Rows configuration = rows(q, n, 12, "q must be (N, 12)");
    const Rows velocity = rows(u, n, 6, "u must be (N, 6)");
    double* to = state(out, n, 12, "out must be (N, 12)");
    py::gil_scoped_release release;
    groups(n, 1, [&](int64_t first, int count) {
        RigidGroup g;
        g.h = h;
        g.count = count;
        gather(configuration, first, count, g.q);
        gather(velocity, first, count, g.u);
        run<kl::rigid_half>(g);
        scatter(g.qh, 12, first, count, to);
    });
}

RigidBodies rigid_bodies(Floats q, Floats u, Floats inertia, Floats inverse, Floats mass, double h,
                         int scheme, double tolerance) {
    const int64_t n = bodies(q, 12, "q must be (N, 12)");
    require(scheme >= kl::RIG_POS && scheme <= kl::RIG_IMP, "scheme must be 0, 1 or 2");
    return {state(q, n, 12, "q must be (N, 12)"),
            state(u, n, 6, "u must be (N, 6)"),
            rows(inertia, n, 9, "inertia must be (N, 3, 3) or (3, 3)"),
            rows(inverse, n, 9, "inverse must be (N, 3, 3) or (3, 3)"),
            rows(mass, n, 1, "mass must be (N) or one number"),
            h,
            tolerance,
            scheme};
}

int64_t rigid_finish(Floats q, Floats u, Floats qh, Floats load, Floats inertia,
                     Floats inverse, Floats mass, double h, int scheme, double tolerance) {
    const RigidBodies all = rigid_bodies(q, u, inertia, inverse, mass, h, scheme, tolerance);
    const int64_t n = q.size() / 12;
    const Rows middle = rows(qh, n, 12, "qh must be (N, 12)");
    const Rows loads = rows(load, n, 6, "load must be (N, 6) or (6)");
    Failure failure;
    py::gil_scoped_release release;
    groups(n, 1, [&](int64_t first, int count) {
        RigidGroup g;
        all.gather_to(g, first, count);
        gather(middle, first, count, g.qh);
        gather(loads, first, count, g.load);
        run<kl::rigid_finish>(g);
        noted(g, first, 0, failure);
        all.scatter_from(g, first, count);
    });
    return failure.first.first;
}

std::pair<int64_t, int64_t> rigid_steps(Floats q, Floats u, Floats inertia, Floats inverse,
                                        Floats mass, Floats acceleration, Floats spatial,
                                        Floats convected, double h, int64_t steps, int scheme, double tolerance,
                                        const py::object& work) {
    const RigidBodies all = rigid_bodies(q, u, inertia, inverse, mass, h, scheme, tolerance);
    const int64_t n = q.size() / 12;
    const Rows a = rows(acceleration, n, 3, "acceleration must be (N, 3) or (3)");
    const Rows fixed = rows(spatial, n, 6, "spatial must be (N, 6) or (6)");
    const Rows turning = rows(convected, n, 6, "convected must be (N, 6) or (6)");
    double* total = optional_state(work, n, "work must be float64 (N)");
    Failure failure;
    py::gil_scoped_release release;
    groups(n, steps, [&](int64_t first, int count) {
        RigidGroup g;
        all.gather_to(g, first, count);
        gather(a, first, count, g.acceleration);
        gather(fixed, first, count, g.spatial);
        gather(turning, first, count, g.convected);
        if (total)  // from where it was, so that it does not matter how steps are divided into calls
            for (int l = 0; l < count; ++l) g.work[0][l] = total[first + l];
        for (int64_t step = 0; step < steps; ++step) {
            run<kl::rigid_half>(g);
            run<kl::rigid_load>(g);
            run<kl::rigid_finish>(g);
            if (noted(g, first, step, failure)) break;
        }
        all.scatter_from(g, first, count);
        if (total)
            for (int l = 0; l < count; ++l) total[first + l] = g.work[0][l];
    });
    return failure.first;
}

struct PseudoBodies {
    double *q, *u;
    Rows euler, mass, volume, C, damping;
    double h, tolerance;
    int scheme;

    void gather_to(PseudoGroup& g, int64_t first, int count) const {
        g.h = h;
        g.tolerance = tolerance;
        g.scheme = scheme;
        g.count = count;
        gather({q, 12, 12}, first, count, g.q);
        gather({u, 12, 12}, first, count, g.u);
        gather(euler, first, count, g.euler);
        gather(mass, first, count, g.mass);
        gather(volume, first, count, g.volume);
        gather(C, first, count, g.C);
        gather(damping, first, count, g.damping);
        std::fill(*g.work, *g.work + LANES, 0.0);
    }
    void scatter_from(const PseudoGroup& g, int64_t first, int count) const {
        scatter(g.q, 12, first, count, q);
        scatter(g.u, 12, first, count, u);
    }
};

PseudoBodies pseudo_bodies(Floats q, Floats u, Floats euler, Floats mass, Floats volume, Floats C,
                           Floats damping, double h, int scheme, double tolerance) {
    const int64_t n = bodies(q, 12, "q must be (N, 12)");
    require(scheme >= kl::DEF_EXP && scheme <= kl::ENERGY_MOMENTUM, "scheme must be 0, 1 or 2");
    return {state(q, n, 12, "q must be (N, 12)"),
            state(u, n, 12, "u must be (N, 12)"),
            rows(euler, n, 9, "euler must be (N, 3, 3) or (3, 3)"),
            rows(mass, n, 1, "mass must be (N) or one number"),
            rows(volume, n, 1, "volume must be (N) or one number"),
            rows(C, n, 36, "C must be (N, 6, 6) or (6, 6)"),
            rows(damping, n, 1, "damping must be (N) or one number"),
            h,
            tolerance,
            scheme};
}

int64_t pseudo_finish(Floats q, Floats u, Floats load, Floats euler, Floats mass,
                      Floats volume, Floats C, Floats damping, double h, int scheme,
                      double tolerance) {
    const PseudoBodies all = pseudo_bodies(q, u, euler, mass, volume, C, damping, h, scheme, tolerance);
    const int64_t n = q.size() / 12;
    const Rows loads = rows(load, n, 12, "load must be (N, 12) or (12)");
    Failure failure;
    py::gil_scoped_release release;
    groups(n, 1, [&](int64_t first, int count) {
        PseudoGroup g;
        all.gather_to(g, first, count);
        gather(loads, first, count, g.load);
        run<kl::pseudo_finish>(g);
        noted(g, first, 0, failure);
        all.scatter_from(g, first, count);
    });
    return failure.first.first;
}

std::pair<int64_t, int64_t> pseudo_steps(Floats q, Floats u, Floats euler, Floats mass,
                                         Floats volume, Floats C, Floats damping,
                                         Floats acceleration, Floats spatial, double h, int64_t steps,
                                         int scheme, double tolerance, const py::object& work) {
    const PseudoBodies all = pseudo_bodies(q, u, euler, mass, volume, C, damping, h, scheme, tolerance);
    const int64_t n = q.size() / 12;
    const Rows a = rows(acceleration, n, 3, "acceleration must be (N, 3) or (3)");
    const Rows fixed = rows(spatial, n, 12, "spatial must be (N, 12) or (12)");
    double* total = optional_state(work, n, "work must be float64 (N)");
    Failure failure;
    py::gil_scoped_release release;
    groups(n, steps, [&](int64_t first, int count) {
        PseudoGroup g;
        all.gather_to(g, first, count);
        gather(a, first, count, g.acceleration);
        gather(fixed, first, count, g.load);
        for (int i = 0; i < 3; ++i)
            for (int l = 0; l < LANES; ++l) g.load[9 + i][l] += g.mass[0][l] * g.acceleration[i][l];
        if (total)
            for (int l = 0; l < count; ++l) g.work[0][l] = total[first + l];
        for (int64_t step = 0; step < steps; ++step) {
            run<kl::pseudo_finish>(g);
            if (noted(g, first, step, failure)) break;
        }
        all.scatter_from(g, first, count);
        if (total)
            for (int l = 0; l < count; ++l) total[first + l] = g.work[0][l];
    });
    return failure.first;
}

}  // namespace

PYBIND11_MODULE(_motion, m) {
    kl::common(m);
    using py::arg;
    const char* one = "q and u at the end of the step; returns the first body that failed, or -1";
    const char* many = "q and u after steps with constant loads; returns the first body that failed and its step";
    m.def("rigid_half", &rigid_half, "out = q at mid-step", arg("q"), arg("u"), arg("h"), arg("out"));
    m.def("rigid_finish", &rigid_finish, one, arg("q"), arg("u"), arg("qh"), arg("load"), arg("inertia"),
          arg("inverse"), arg("mass"), arg("h"), arg("scheme"), arg("tolerance"));
    m.def("rigid_steps", &rigid_steps, many, arg("q"), arg("u"), arg("inertia"), arg("inverse"), arg("mass"),
          arg("acceleration"), arg("spatial"), arg("convected"), arg("h"), arg("steps"), arg("scheme"),
          arg("tolerance"), arg("work") = py::none());
    m.def("pseudo_finish", &pseudo_finish, one, arg("q"), arg("u"), arg("load"), arg("euler"), arg("mass"),
          arg("volume"), arg("C"), arg("damping"), arg("h"), arg("scheme"), arg("tolerance"));
    m.def("pseudo_steps", &pseudo_steps, many, arg("q"), arg("u"), arg("euler"), arg("mass"), arg("volume"), arg("C"),
          arg("damping"), arg("acceleration"), arg("spatial"), arg("h"), arg("steps"), arg("scheme"),
          arg("tolerance"), arg("work") = py::none());
}
