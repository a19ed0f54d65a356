// The elementary functions of <math.h>, with the same bits on every processor.
//
// The C library promises no last bit of sin, exp or pow, and glibc's differ between processors: it chooses among
// variants with and without fused multiply-add. A flight would differ with them. These are SLEEF's deterministic
// functions (https://sleef.org), which compute the same everywhere: cinz, in plain C and without fused
// multiply-add. Their error is below 1 ulp, erfc's below 1.5.
//
// They have the names of the C library's, so callers need no others. A program that links this file exports them
// (deterministic_math.list), and the dynamic linker asks the program before any library. So ODE, libsdformat and a
// firmware that is loaded as a library get them too. What IEEE 754 or C define to the last bit (sqrt, fma, fmod,
// ldexp, floor ...) stays with the C library. A test lists what the whole process takes from there, and allows only
// that.
#include <sleef.h>

// No <math.h>: the compiler knows these names, and would warn of a wrong signature.
#define FUNCTION_OF_ONE(name, accuracy)                                        \
  double name(double x) { return Sleef_cinz_##name##d1_##accuracy##purec(x); } \
  float name##f(float x) { return Sleef_cinz_##name##f1_##accuracy##purec(x); }
#define FUNCTION_OF_TWO(name, accuracy)                                                     \
  double name(double x, double y) { return Sleef_cinz_##name##d1_##accuracy##purec(x, y); } \
  float name##f(float x, float y) { return Sleef_cinz_##name##f1_##accuracy##purec(x, y); }

FUNCTION_OF_ONE(sin, u10)
FUNCTION_OF_ONE(cos, u10)
FUNCTION_OF_ONE(tan, u10)
FUNCTION_OF_ONE(asin, u10)
FUNCTION_OF_ONE(acos, u10)
FUNCTION_OF_ONE(atan, u10)
FUNCTION_OF_TWO(atan2, u10)
FUNCTION_OF_ONE(sinh, u10)
FUNCTION_OF_ONE(cosh, u10)
FUNCTION_OF_ONE(tanh, u10)
FUNCTION_OF_ONE(asinh, u10)
FUNCTION_OF_ONE(acosh, u10)
FUNCTION_OF_ONE(atanh, u10)
FUNCTION_OF_ONE(exp, u10)
FUNCTION_OF_ONE(exp2, u10)
FUNCTION_OF_ONE(exp10, u10)
FUNCTION_OF_ONE(expm1, u10)
FUNCTION_OF_ONE(log, u10)
FUNCTION_OF_ONE(log2, u10)
FUNCTION_OF_ONE(log10, u10)
FUNCTION_OF_ONE(log1p, u10)
FUNCTION_OF_TWO(pow, u10)
FUNCTION_OF_ONE(cbrt, u10)
FUNCTION_OF_TWO(hypot, u05)
FUNCTION_OF_ONE(erf, u10)
FUNCTION_OF_ONE(erfc, u15)
FUNCTION_OF_ONE(tgamma, u10)

// Both at once: where the compiler finds a sine and a cosine of one angle, it may call this instead. The same bits.
void sincos(double x, double* sine, double* cosine) {
  *sine = Sleef_cinz_sind1_u10purec(x);
  *cosine = Sleef_cinz_cosd1_u10purec(x);
}
void sincosf(float x, float* sine, float* cosine) {
  *sine = Sleef_cinz_sinf1_u10purec(x);
  *cosine = Sleef_cinz_cosf1_u10purec(x);
}

// The absolute value of a complex number.
double cabs(double _Complex z) { return hypot(__real__ z, __imag__ z); }
float cabsf(float _Complex z) { return hypotf(__real__ z, __imag__ z); }
