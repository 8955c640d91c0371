/* A number that counts what is done with it: our generated C is compiled with it in place of double. */
#include <cerrno>
#include <cmath>
#include <cstdbool>
#include <cstdint>
#include <cstring>
#include <type_traits>
static long counts[5];
struct Counted {
    double x;
    Counted() = default;
    template <class T, class = std::enable_if_t<std::is_arithmetic<T>::value>> constexpr Counted(T y) : x((double)y) {}
    explicit operator int64_t() const { return (int64_t)x; }
};
#define BINARY(op, n) static inline Counted operator op(Counted a, Counted b) { counts[n]++; return Counted(a.x op b.x); } \
    static inline Counted &operator op##=(Counted &a, Counted b) { counts[n]++; a.x op##= b.x; return a; }
BINARY(+, 0) BINARY(-, 0) BINARY(*, 1) BINARY(/, 2)
#define COMPARE(op) static inline bool operator op(Counted a, Counted b) { counts[4]++; return a.x op b.x; }
COMPARE(<) COMPARE(>) COMPARE(<=) COMPARE(>=) COMPARE(==) COMPARE(!=)
static inline Counted operator-(Counted a) { return Counted(-a.x); }
#define FUNCTION(f) static inline Counted f(Counted a) { counts[3]++; return Counted(::f(a.x)); }
FUNCTION(sqrt) FUNCTION(exp) FUNCTION(log) FUNCTION(erfc)
static inline Counted pow(Counted a, Counted b) { counts[3]++; return Counted(::pow(a.x, b.x)); }
static inline Counted fabs(Counted a) { return Counted(::fabs(a.x)); }
#undef isfinite
#undef isnan
#undef isinf
static inline bool isfinite(Counted a) { return std::isfinite(a.x); }
static inline bool isnan(Counted a) { return std::isnan(a.x); }
static inline bool isinf(Counted a) { return std::isinf(a.x); }
