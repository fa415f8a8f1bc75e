// Steps of many rigid or pseudo-rigid bodies, in place.
//
// Arrays hold N bodies with any leading axes.  What a body is made of (inertia, mass …) and constant loads may
// also be given once for all.  Bodies do not meet, so tasks of any size give the same numbers.

#include <algorithm>
#include <mutex>
#include <string>
#include <utility>

#include "arrays.hpp"
#include "pseudo_rigid.hpp"

namespace {

using kl::LANES;
using kl::Pack;
using kl::PseudoGroup;
using kl::RigidGroup;

using Floats = kl::Numbers;

constexpr int64_t GRAIN = 1024;  // steps of a body in one task

void require(bool condition, const char* name, const char* what) {
    if (!condition) throw std::invalid_argument(std::string(name) + what);
}

void check_size(bool right, const char* name, int width) {
    if (!right) throw std::invalid_argument(name + (" must be (N, " + std::to_string(width)) + ") numbers");
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

// Arrays of bodies, each of which fills some packs of a group.
template <class Group>
class Bodies {
public:
    Bodies(Floats q, double h, int integrator = 0, double tolerance = 0)
        : n(q.size() / 12), h(h), tolerance(tolerance), integrator(integrator) {
        require(q.ndim() > 0 && q.shape(q.ndim() - 1) == 12, "q", " must be (N, 12)");
        require(0 <= integrator && integrator <= 2, "integrator", " must be 0, 1 or 2");
    }

    // `width` numbers of each body, or of one for all.
    template <int width>
    void add(Pack (Group::*to)[width], Floats array, const char* name) {
        const bool one = array.size() == width;
        check_size(one || array.size() == n * width, name, width);
        fields[count++] = {offset(to), width, one ? 0 : width, array.data(), nullptr};
    }

    // What the steps change.
    template <int width>
    void add_state(Pack (Group::*to)[width], Floats array, const char* name) {
        check_size(array.size() == n * width, name, width);
        require(array.writeable(), name, " is read-only and cannot be advanced in place");
        double* data = kl::Array<double>(array).mutable_data();
        fields[count++] = {offset(to), width, width, data, data};
    }

    // Go through `steps` steps, each group while it is in the cache, on all threads if there are enough bodies.
    template <class F>
    std::pair<int64_t, int64_t> run(int64_t steps, const F& step) const {
        const int64_t few = std::max<int64_t>(1, GRAIN / std::max<int64_t>(1, steps));
        Failure failure;
        kl::GilReleased release;
        kl::parallel_ranges(n, (few + LANES - 1) / LANES * LANES, [&](int64_t first, int64_t last) {
            for (; first < last; first += LANES)
                run_group(first, static_cast<int>(std::min<int64_t>(LANES, last - first)), steps, step, failure);
        });
        return failure.first;
    }

private:
    struct Field {
        ptrdiff_t offset;
        int width, stride;  // stride 0: one body's numbers for all
        const double* from;
        double* to;  // null where nothing changes

        // Bodies first … first + count to packs; lanes past them repeat the first, and are never stored.
        void gather(int64_t first, int count, Pack* packs) const {
            if (!stride || count == 1) {
                for (int k = 0; k < width; ++k) std::fill_n(packs[k], LANES, from[first * stride + k]);
                return;
            }
            for (int l = 0; l < LANES; ++l) {
                const double* body = from + (first + (l < count ? l : 0)) * stride;
                for (int k = 0; k < width; ++k) packs[k][l] = body[k];
            }
        }
        void scatter(const Pack* packs, int64_t first, int count) const {
            for (int l = 0; l < count; ++l)
                for (int k = 0; k < width; ++k) to[(first + l) * width + k] = packs[k][l];
        }
    };

    template <int width>
    static ptrdiff_t offset(Pack (Group::*to)[width]) {
        static Group group;
        return (group.*to) - reinterpret_cast<Pack*>(&group);
    }

    template <class F>
    void run_group(int64_t first, int bodies, int64_t steps, const F& step, Failure& failure) const {
        Group g;
        Pack* packs = reinterpret_cast<Pack*>(&g);
        g.h = h;
        g.tolerance = tolerance;
        g.integrator = integrator;
        g.count = bodies;
        std::fill_n(*g.work, LANES, 0.0);
        std::fill_n(*g.flaw, LANES, 0.0);
        for (int i = 0; i < count; ++i) fields[i].gather(first, bodies, packs + fields[i].offset);
        bool failed = false;
        for (int64_t i = 0; i < steps && !failed; ++i) {
            step(g, i);
            for (int l = 0; l < bodies && !failed; ++l) {
                failed = g.flaw[0][l] != 0;
                if (failed) failure.note(first + l, i);
            }
        }
        for (int i = 0; i < count; ++i)
            if (fields[i].to) fields[i].scatter(packs + fields[i].offset, first, bodies);
    }

    int64_t n;
    double h, tolerance;
    int integrator, count = 0;
    Field fields[12];
};

// A kernel, never inlined: elsewhere the compiler might join its products and sums in another way, and one step
// would no longer be one of many to the bit.
template <auto KERNEL, class Group>
__attribute__((noinline)) void run(Group& g) {
    KERNEL(g);
}

Bodies<RigidGroup> rigid_bodies(Floats q, Floats u, Floats inertia, Floats inverse, Floats mass, double h,
                                int integrator, double tolerance) {
    Bodies<RigidGroup> all(q, h, integrator, tolerance);
    all.add_state(&RigidGroup::q, q, "q");
    all.add_state(&RigidGroup::u, u, "u");
    all.add(&RigidGroup::inertia, inertia, "inertia");
    all.add(&RigidGroup::inverse, inverse, "inverse");
    all.add(&RigidGroup::mass, mass, "mass");
    return all;
}

Bodies<PseudoGroup> pseudo_bodies(Floats q, Floats u, Floats euler, Floats mass, Floats volume, Floats C,
                                  Floats damping, double h, int integrator, double tolerance) {
    Bodies<PseudoGroup> all(q, h, integrator, tolerance);
    all.add_state(&PseudoGroup::q, q, "q");
    all.add_state(&PseudoGroup::u, u, "u");
    all.add(&PseudoGroup::euler, euler, "euler");
    all.add(&PseudoGroup::mass, mass, "mass");
    all.add(&PseudoGroup::volume, volume, "volume");
    all.add(&PseudoGroup::C, C, "C");
    all.add(&PseudoGroup::damping, damping, "damping");
    return all;
}

// The work of loads, from where it was, so that it does not matter how steps are divided into calls.
template <class Group>
void add_work(Bodies<Group>& all, kl::MaybeNumbers work) {
    if (work) all.add_state(&Group::work, *work, "work");
}

void rigid_half(Floats q, Floats u, double h, Floats out) {
    Bodies<RigidGroup> all(q, h);
    all.add(&RigidGroup::q, q, "q");
    all.add(&RigidGroup::u, u, "u");
    all.add_state(&RigidGroup::qh, out, "out");
    all.run(1, [](RigidGroup& g, int64_t) { run<kl::rigid_half>(g); });
}

int64_t rigid_finish(Floats q, Floats u, Floats qh, Floats load, Floats inertia, Floats inverse, Floats mass,
                     double h, int integrator, double tolerance) {
    Bodies<RigidGroup> all = rigid_bodies(q, u, inertia, inverse, mass, h, integrator, tolerance);
    all.add(&RigidGroup::qh, qh, "qh");
    all.add(&RigidGroup::load, load, "load");
    return all.run(1, [](RigidGroup& g, int64_t) { run<kl::rigid_finish>(g); }).first;
}

std::tuple<int64_t, int64_t> rigid_steps(Floats q, Floats u, Floats inertia, Floats inverse, Floats mass,
                                        Floats acceleration, Floats spatial, Floats convected, double h,
                                        int64_t steps, int integrator, double tolerance, kl::MaybeNumbers work) {
    Bodies<RigidGroup> all = rigid_bodies(q, u, inertia, inverse, mass, h, integrator, tolerance);
    all.add(&RigidGroup::acceleration, acceleration, "acceleration");
    all.add(&RigidGroup::spatial, spatial, "spatial");
    all.add(&RigidGroup::convected, convected, "convected");
    add_work(all, work);
    return all.run(steps, [](RigidGroup& g, int64_t) {
        run<kl::rigid_half>(g);
        run<kl::rigid_load>(g);
        run<kl::rigid_finish>(g);
    });
}

int64_t pseudo_finish(Floats q, Floats u, Floats load, Floats euler, Floats mass, Floats volume, Floats C,
                      Floats damping, double h, int integrator, double tolerance) {
    Bodies<PseudoGroup> all = pseudo_bodies(q, u, euler, mass, volume, C, damping, h, integrator, tolerance);
    all.add(&PseudoGroup::load, load, "load");
    return all.run(1, [](PseudoGroup& g, int64_t) { run<kl::pseudo_finish>(g); }).first;
}

std::tuple<int64_t, int64_t> pseudo_steps(Floats q, Floats u, Floats euler, Floats mass, Floats volume, Floats C,
                                         Floats damping, Floats acceleration, Floats spatial, double h,
                                         int64_t steps, int integrator, double tolerance, kl::MaybeNumbers work) {
    Bodies<PseudoGroup> all = pseudo_bodies(q, u, euler, mass, volume, C, damping, h, integrator, tolerance);
    all.add(&PseudoGroup::acceleration, acceleration, "acceleration");
    all.add(&PseudoGroup::load, spatial, "spatial");
    add_work(all, work);
    return all.run(steps, [](PseudoGroup& g, int64_t step) {
        for (int i = 0; step == 0 && i < 3; ++i)
            for (int l = 0; l < LANES; ++l) g.load[9 + i][l] += g.mass[0][l] * g.acceleration[i][l];
        run<kl::pseudo_finish>(g);
    });
}

}  // namespace

KL_MODULE(_motion, m) {
    kl::interruption() = nullptr;  // bodies change in place: all of them take the step, or none
    const char* one = "q and u at the end of the step; returns the first body that failed, or -1";
    const char* many = "q and u after steps with constant loads; returns the first body that failed and its step";
    kl::define<&rigid_half>(m, "rigid_half", "out = q at mid-step", {"q", "u", "h", "out"});
    kl::define<&rigid_finish>(m, "rigid_finish", one, {"q", "u", "qh", "load", "inertia", "inverse", "mass", "h",
                                                       "integrator", "tolerance"});
    kl::define<&rigid_steps>(m, "rigid_steps", many, {"q", "u", "inertia", "inverse", "mass", "acceleration",
                                                      "spatial", "convected", "h", "steps", "integrator",
                                                      "tolerance", {"work", Py_None}});
    kl::define<&pseudo_finish>(m, "pseudo_finish", one, {"q", "u", "load", "euler", "mass", "volume", "C", "damping",
                                                         "h", "integrator", "tolerance"});
    kl::define<&pseudo_steps>(m, "pseudo_steps", many, {"q", "u", "euler", "mass", "volume", "C", "damping",
                                                        "acceleration", "spatial", "h", "steps", "integrator",
                                                        "tolerance", {"work", Py_None}});
}
