// Threads that all kernels of the process share, whichever module they stand in.
//
// parallel(n, f) calls f(0) … f(n-1), each once, on any thread.  Callers cut their work into tasks
// that do not depend on the number of threads, so that results do not either.

#pragma once
#include <atomic>
#include <cstdint>

namespace kl {

using Interruption = void (*)();

// A function of the number of a task, which lives with its caller; std::function takes long to compile.
struct Task {
    const void* function;
    void (*call)(const void* function, int64_t task);

    void operator()(int64_t task) const { call(function, task); }
};

// The pool, in threads.cpp.
class Threads {
public:
    virtual void run(int64_t tasks, const Task& task, Interruption interrupt) = 0;
    virtual void look(Interruption interrupt) = 0;

    std::atomic<int> wanted{1};

protected:
    ~Threads() = default;
};

// Found when a module is imported.
inline Threads*& threads() {
    static Threads* shared = nullptr;
    return shared;
}

// What a thread that has called parallel does every 50 ms; it throws to give the work up.  Bindings let it
// look for signals, so that Ctrl-C ends a kernel.
inline Interruption& interruption() {
    static Interruption interrupt = nullptr;
    return interrupt;
}

// Tasks that take long call it every now and then: it throws where the work is given up.
inline void look() { threads()->look(interruption()); }

inline int wanted_threads() { return threads()->wanted; }

// One call of parallel at a time uses the pool; another one, from a second Python thread or from
// within a task, runs its tasks itself.
template <class F>
void parallel(int64_t tasks, const F& f) {
    const auto call = [](const void* function, int64_t task) { (*static_cast<const F*>(function))(task); };
    threads()->run(tasks, {&f, call}, interruption());
}

// parallel over ranges [first, last) of at most `grain` of n items.
template <class F>
void parallel_ranges(int64_t n, int64_t grain, const F& f) {
    parallel((n + grain - 1) / grain, [&](int64_t task) {
        const int64_t first = task * grain;
        f(first, first + grain < n ? first + grain : n);
    });
}

constexpr int64_t MANY = 1 << 16;  // after as many small steps, it is time to look

}  // namespace kl
