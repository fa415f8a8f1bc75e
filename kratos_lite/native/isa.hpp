// The instruction set of this machine, chosen at run time.
//
// A kernel is a template over its vector width, forced inline into one function for each
// instruction set:
//
//     template <int V> KL_INLINE void body(Args args) { ... kl::vec<double, V> ... }
//     dispatch<double>([&](auto V) KL_INLINE_LAMBDA { body<V>(args); });
//
// runs body<8> with AVX-512, body<4> with AVX2 and FMA, else body<2>.  The width follows the
// instruction set: eight doubles at once would spill on AVX2.  With KL_ISA, which is 0, 1 or 2 of Isa,
// only functions for that one are compiled, and modules do not load where it is too much.

#pragma once
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <type_traits>
#include <vector>

#if !defined(__GNUC__) && !defined(__clang__)
#error "kernels are written with vectors of GCC and Clang; on Windows clang-cl compiles them"
#endif
#if defined(__x86_64__)
#include <cpuid.h>
#endif

#define KL_INLINE inline __attribute__((always_inline))
#define KL_INLINE_LAMBDA __attribute__((always_inline))

namespace kl {

enum class Isa { base, avx2, avx512 };

#if defined(__x86_64__)
// What the processor has and the system saves; compilers have a function for this, but not on every system the
// library behind it.
inline Isa best_isa() {
    const auto all = [](unsigned bits, unsigned wanted) { return (bits & wanted) == wanted; };
    unsigned a, b, c, d;
    constexpr unsigned FMA = 1u << 12, OSXSAVE = 1u << 27, AVX = 1u << 28;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !all(c, FMA | OSXSAVE | AVX)) return Isa::base;
    unsigned saved;
    __asm__("xgetbv" : "=a"(saved), "=d"(d) : "c"(0));
    constexpr unsigned AVX2 = 1u << 5, F = 1u << 16, DQ = 1u << 17, BW = 1u << 30, VL = 1u << 31;
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d) || !all(b, AVX2) || !all(saved, 0x06)) return Isa::base;
    return all(b, F | DQ | BW | VL) && all(saved, 0xe6) ? Isa::avx512 : Isa::avx2;
}
#else
inline Isa best_isa() { return Isa::base; }
#endif

// KRATOS_LITE_ISA lowers the choice, never above what the machine has.
inline Isa isa_wanted() {
    static const Isa chosen = [] {
        const Isa best = best_isa();
        const char* wanted = std::getenv("KRATOS_LITE_ISA");
        if (!wanted) return best;
        if (!std::strcmp(wanted, "base")) return Isa::base;
        if (!std::strcmp(wanted, "avx2") && best != Isa::base) return Isa::avx2;
        return best;
    }();
    return chosen;
}

#ifdef KL_ISA
constexpr Isa isa() { return Isa{KL_ISA}; }
#define KL_IF constexpr
#else
inline Isa isa() { return isa_wanted(); }
#define KL_IF
#endif

inline const char* isa_name() {
    return isa() == Isa::avx512 ? "AVX-512" : isa() == Isa::avx2 ? "AVX2" : "baseline";
}

// Doubles in one vector.
inline int vector_width() { return isa() == Isa::avx512 ? 8 : isa() == Isa::avx2 ? 4 : 2; }

// GCC's vector extension: element-wise + - * / on V numbers.
template <class T, int V>
struct vec_of {
    typedef T type __attribute__((vector_size(V * sizeof(T)), aligned(sizeof(T)), may_alias));
};
template <class T, int V>
using vec = typename vec_of<T, V>::type;

// Numbers I of a and b, one after the other.
template <class T, int V, int... I>
KL_INLINE void pick(vec<T, V>& to, const vec<T, V>& a, const vec<T, V>& b) {
#if defined(__clang__) || __GNUC__ >= 12
    to = __builtin_shufflevector(a, b, I...);
#else
    typedef std::conditional_t<sizeof(T) == 4, int32_t, int64_t> Index;
    to = __builtin_shuffle(a, b, vec<Index, V>{I...});
#endif
}

// Working memory, aligned for vectors.
class Workspace {
public:
    explicit Workspace(int64_t size) : numbers(size + 8) {}
    double* data() {
        return reinterpret_cast<double*>((reinterpret_cast<uintptr_t>(numbers.data()) + 63) / 64 * 64);
    }

private:
    std::vector<double> numbers;
};

template <int bytes, class T, class F>
KL_INLINE void call(const F& f) {
    // GCC 12 may leave the stack of such a function misaligned for arrays there which loops reach by a pointer
    // alone, as at -O2: a variable that is aligned by itself keeps it aligned.
    alignas(bytes) [[maybe_unused]] volatile char aligned = 0;
    f(std::integral_constant<int, bytes / sizeof(T)>());
}

#if defined(__x86_64__)
template <class T, class F>
__attribute__((target("avx512f,avx512dq,avx512vl,avx512bw,avx2,fma"))) inline void call_avx512(const F& f) {
    call<64, T>(f);
}
template <class T, class F>
__attribute__((target("avx2,fma"))) inline void call_avx2(const F& f) {
    call<32, T>(f);
}
#endif

// f(V) with V numbers of type T in one vector.
template <class T, class F>
inline void dispatch(const F& f) {
#if defined(__x86_64__)
    if KL_IF (isa() == Isa::avx512) call_avx512<T>(f);
    else if KL_IF (isa() == Isa::avx2) call_avx2<T>(f);
    else
#endif
    call<16, T>(f);
}

// A function that runs a body over double.
#define KL_DISPATCH(name, body, ...) \
    inline void name(__VA_ARGS__ args) { \
        kl::dispatch<double>([&](auto V) KL_INLINE_LAMBDA { body<V>(args); }); \
    }

}  // namespace kl
