/// @file version.hpp
/// The version of cfp, the language it needs, and what every header needs of it. Included by every header, so that a
/// project with an older language setting reads one sentence instead of a page of template errors.
#pragma once

#define CFP_VERSION_MAJOR 0
#define CFP_VERSION_MINOR 1
#define CFP_VERSION_PATCH 0
#define CFP_VERSION_STRING "0.1.0"

#if __cplusplus < 201703L && !(defined(_MSVC_LANG) && _MSVC_LANG >= 201703L)
#error \
    "cfp needs C++17: compile with -std=c++17 or newer (a -std=c++11 or -std=c++14 in CMAKE_CXX_FLAGS wins over CMake's own setting)."
#endif

// The words of every header: std::size_t and the integers of fixed width.
#include <cstddef>
#include <cstdint>

// Functions stand in the inline namespace CFP_ISA, types do not: units compiled with different vector flags share
// types, and never a function, whose instructions the other unit's machine might not have.
#if defined(EIGEN_DONT_VECTORIZE)
#define CFP_ISA isa_scalar
#elif defined(__AVX512F__) && defined(__AVX512DQ__) && defined(__AVX512BW__) && defined(__AVX512VL__)
#define CFP_ISA isa_avx512
#elif defined(__AVX512F__)
#define CFP_ISA isa_avx512f
#elif defined(__AVX2__) && defined(__FMA__)
#define CFP_ISA isa_avx2_fma
#elif defined(__AVX2__)
#define CFP_ISA isa_avx2
#elif defined(__AVX__) && defined(__FMA__)
#define CFP_ISA isa_avx_fma
#elif defined(__AVX__)
#define CFP_ISA isa_avx
#elif defined(__SSE4_1__)
#define CFP_ISA isa_sse4
#else
#define CFP_ISA isa_base
#endif

// Member functions of shared types that compute are inlined everywhere, for the same reason; so are, for speed, a few
// functions that GCC leaves out of the loops over pairs.
#if defined(__GNUC__)
#define CFP_INLINE inline __attribute__((always_inline))
#elif defined(_MSC_VER)
#define CFP_INLINE __forceinline
#else
#define CFP_INLINE inline
#endif

#if defined(__GNUC__) && defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#pragma GCC warning \
    "cfp: -ffinite-math-only (part of -ffast-math) removes the NaN checks that cfp's guarantees rest on; it is not supported."
#endif

// Programmer errors only (two arrays of different length, a null view, unsorted input where sorted is required); never
// bad data, which gets a status. On in debug builds; define CFP_ASSERT yourself, before the first cfp header and
// equally in every unit of a program, to route it elsewhere.
#ifndef CFP_ASSERT
#include <cassert>
#define CFP_ASSERT(condition) assert(condition)
#endif
