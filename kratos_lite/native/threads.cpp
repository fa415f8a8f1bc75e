// The pool of threads of the process: they wait passively, and are left to the operating system at its end, as
// joining them there can hang.

#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>
#ifndef _WIN32
#include <unistd.h>
#endif

#include "arrays.hpp"

namespace {

using namespace kl;

constexpr std::chrono::milliseconds PATIENCE{50};

struct GivenUp {};

// What a thread looks at while it works: whether the pool that it belongs to has given up, or the clock.
class Watch {
public:
    const std::atomic<bool>* given_up = nullptr;

    void look(Interruption interrupt) {
        if (given_up) {
            if (*given_up) throw GivenUp{};
            return;
        }
        const auto now = std::chrono::steady_clock::now();
        if (!interrupt || now - last < PATIENCE) return;
        last = now;
        interrupt();
    }

private:
    std::chrono::steady_clock::time_point last = std::chrono::steady_clock::now();
};
thread_local Watch watch;

class Pool {
public:
    explicit Pool(int threads) {
        try {
            for (int i = 1; i < threads; ++i) workers.emplace_back([this] { wait_for_work(); });
        } catch (const std::system_error&) {
            // the system gives no more threads: those there are do the work
        }
    }

    ~Pool() {
        {
            std::lock_guard<std::mutex> lock(mutex);
            over = true;
            ++generation;
        }
        start.notify_all();
        for (std::thread& worker : workers) worker.join();
    }

    // It returns when every task is done, whether or not all threads woke up in time to help.
    void run(int64_t tasks, const Task& task, Interruption interrupt) {
        {
            std::lock_guard<std::mutex> lock(mutex);
            job = &task;
            total = tasks;
            next = 0;
            given_up = false;
            ++generation;
        }
        start.notify_all();
        work(task, tasks, interrupt);
        std::unique_lock<std::mutex> lock(mutex);
        job = nullptr;
        while (!done.wait_for(lock, PATIENCE, [this] { return helping == 0; })) {
            lock.unlock();
            try {
                watch.look(interrupt);
            } catch (...) {
                give_up();
            }
            lock.lock();
        }
        if (error) std::rethrow_exception(std::exchange(error, nullptr));
    }

private:
    void work(const Task& task, int64_t tasks, Interruption interrupt) {
        for (int64_t i; (i = next++) < tasks;) {
            try {
                watch.look(interrupt);
                task(i);
            } catch (...) {
                give_up();
                next = tasks;
            }
        }
    }

    void give_up() {
        std::lock_guard<std::mutex> lock(mutex);
        if (!error) error = std::current_exception();
        given_up = true;
    }

    void wait_for_work() {
        watch.given_up = &given_up;
        std::unique_lock<std::mutex> lock(mutex);
        for (uint64_t seen = 0;;) {
            start.wait(lock, [&] { return generation != seen; });
            seen = generation;
            if (over) return;
            if (!job) continue;
            const auto& task = *job;
            const int64_t tasks = total;
            ++helping;
            lock.unlock();
            work(task, tasks, nullptr);
            lock.lock();
            if (--helping == 0) done.notify_one();
        }
    }

    std::vector<std::thread> workers;
    std::mutex mutex;
    std::condition_variable start, done;
    const Task* job = nullptr;
    std::atomic<int64_t> next{0};
    std::atomic<bool> given_up{false};  // a task has failed, so that the others need not be finished
    int64_t total = 0;
    int helping = 0;
    bool over = false;
    uint64_t generation = 0;
    std::exception_ptr error;
};

class Shared final : public Threads {
public:
    void run(int64_t tasks, const Task& task, Interruption interrupt) override {
        if (tasks > 1 && wanted > 1 && !busy.exchange(true)) {
            const Free again{busy};
            return ready().run(tasks, task, interrupt);
        }
        for (int64_t i = 0; i < tasks; ++i) {
            watch.look(interrupt);
            task(i);
        }
    }

    void look(Interruption interrupt) override { watch.look(interrupt); }

private:
    struct Free {
        std::atomic<bool>& busy;
        ~Free() { busy = false; }
    };

    // The pool, made anew for another number of threads, and in a forked process, which has none of its parent's.
    Pool& ready() {
#ifndef _WIN32
        const long process = getpid();
#else
        const long process = 0;
#endif
        if (!pool || owner != process || size != wanted) {
            if (owner == process) delete std::exchange(pool, nullptr);
            size = wanted;
            owner = process;
            pool = new Pool(size);
        }
        return *pool;
    }

    std::atomic<bool> busy{false};
    Pool* pool = nullptr;
    long owner = 0;
    int size = 0;
};

Shared shared;
const Threads* const found = threads() = &shared;  // before the module asks for it

void set_threads(int n) { shared.wanted = n < 1 ? 1 : n; }

}  // namespace

KL_MODULE(_threads, m) {
    define<&set_threads>(m, "set_threads", "threads that all kernels use", {"n"});
    Object capsule = Object::of(PyCapsule_New(threads(), POOL, nullptr));
    if (PyModule_AddObject(m.get(), "pool", capsule.get())) throw PythonError{};
    capsule.release();
}
