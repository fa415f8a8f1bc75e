// Turns at what serves one thread at a time.

#pragma once
#include <chrono>
#include <stdexcept>
#include <thread>
#include <utility>

#include "threads.hpp"

namespace kl {

// What serves one thread at a time: the others wait for their turn.  A thread that has it already, in a callback
// or in a handler of signals, would wait for itself, and is refused.
class Turns {
public:
    class Turn {
    public:
        explicit Turn(Turns& of) : turns(&of) {
            const auto own = std::this_thread::get_id();
            if (turns->owner == own) throw std::logic_error("it is at work: a callback cannot use it");
            for (std::thread::id none; !turns->owner.compare_exchange_weak(none, own); none = {}) {
                std::this_thread::sleep_for(std::chrono::microseconds(50));
                look();
            }
        }
        ~Turn() {
            if (turns) turns->owner = std::thread::id();
        }
        Turn(Turn&& other) noexcept : turns(std::exchange(other.turns, nullptr)) {}

    private:
        Turns* turns;
    };

    Turn take() { return Turn(*this); }

private:
    std::atomic<std::thread::id> owner{std::thread::id()};
};

}  // namespace kl
