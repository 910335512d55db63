/* Of math.h and string.h what the core uses: instructions of WebAssembly, and two functions of the compiler's own library. */
#ifndef CFEM_PAGE_MATH_H
#define CFEM_PAGE_MATH_H

#define HUGE_VAL __builtin_huge_val()
#define fabs __builtin_fabs
#define fmax __builtin_fmax
#define fmin __builtin_fmin
#define sqrt __builtin_sqrt
#define sqrtf __builtin_sqrtf

double sin(double x);
double cos(double x);

#endif
