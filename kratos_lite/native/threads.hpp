// A small pool of threads that wait passively.
//
// parallel(n, f) calls f(0) … f(n-1), each once, on any thread.  Callers cut their work into tasks
// that do not depend on the number of threads, so that results do not either.

#pragma once
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>
#ifndef _WIN32
#include <unistd.h>
#endif

namespace kl {

// What a thread that has called parallel does every 50 ms; it throws to give the work up.  Bindings let it
// look for signals, so that Ctrl-C ends a kernel.
inline void (*&interruption())() {
    static void (*look)() = nullptr;
    return look;
}

constexpr std::chrono::milliseconds PATIENCE{50};

// Tasks that take long call look() every now and then: it throws where the work is given up.
class Watch {
public:
    void look() {
        if (of_pool) {
            if (given_up()) throw GivenUp{};
            return;
        }
        const auto now = std::chrono::steady_clock::now();
        if (!interruption() || now - last < PATIENCE) return;
        last = now;
        interruption()();
    }

    // Whether a task of the pool has failed, so that the others need not be finished.
    static std::atomic<bool>& given_up() {
        static std::atomic<bool> failed{false};
        return failed;
    }

    bool of_pool = false;

private:
    struct GivenUp {};
    std::chrono::steady_clock::time_point last = std::chrono::steady_clock::now();
};

inline Watch& watch() {
    static thread_local Watch watch;
    return watch;
}

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
    void run(int64_t tasks, const std::function<void(int64_t)>& task) {
        {
            std::lock_guard<std::mutex> lock(mutex);
            job = &task;
            total = tasks;
            next = 0;
            Watch::given_up() = false;
            ++generation;
        }
        start.notify_all();
        work(task, tasks);
        std::unique_lock<std::mutex> lock(mutex);
        job = nullptr;
        while (!done.wait_for(lock, PATIENCE, [this] { return helping == 0; })) {
            lock.unlock();
            try {
                watch().look();
            } catch (...) {
                give_up();
            }
            lock.lock();
        }
        if (error) std::rethrow_exception(std::exchange(error, nullptr));
    }


private:
    void work(const std::function<void(int64_t)>& task, int64_t tasks) {
        for (int64_t i; (i = next++) < tasks;) {
            try {
                watch().look();
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
        Watch::given_up() = true;
    }

    void wait_for_work() {
        watch().of_pool = true;
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
            work(task, tasks);
            lock.lock();
            if (--helping == 0) done.notify_one();
        }
    }

    std::vector<std::thread> workers;
    std::mutex mutex;
    std::condition_variable start, done;
    const std::function<void(int64_t)>* job = nullptr;
    std::atomic<int64_t> next{0};
    int64_t total = 0;
    int helping = 0;
    bool over = false;
    uint64_t generation = 0;
    std::exception_ptr error;
};

inline int& wanted_threads() {
    static int count = 1;
    return count;
}

// One call of parallel at a time uses the pool; another one, from a second Python thread or from
// within a task, runs its tasks itself.
template <class F>
void parallel(int64_t tasks, const F& f) {
    static std::mutex busy;
    static Pool* pool = nullptr;
    static long owner = 0;
    static int size = 0;
#ifndef _WIN32
    const long process = getpid();
#else
    const long process = 0;
#endif
    std::unique_lock<std::mutex> lock(busy, std::try_to_lock);
    if (tasks <= 1 || wanted_threads() <= 1 || !lock) {
        for (int64_t i = 0; i < tasks; ++i) {
            watch().look();
            f(i);
        }
        return;
    }
    if (!pool || owner != process || size != wanted_threads()) {
        if (owner == process) delete pool;  // a forked process has none of its parent's threads
        pool = new Pool(wanted_threads());  // left to the operating system at exit: joining there can hang
        owner = process;
        size = wanted_threads();
    }
    pool->run(tasks, f);
}

// parallel over ranges [first, last) of at most `grain` of n items.
template <class F>
void parallel_ranges(int64_t n, int64_t grain, const F& f) {
    parallel((n + grain - 1) / grain, [&](int64_t task) {
        const int64_t first = task * grain;
        f(first, first + grain < n ? first + grain : n);
    });
}

}  // namespace kl
