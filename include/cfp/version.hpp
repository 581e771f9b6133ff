/// @file version.hpp
/// The version of cfp and the language it needs. Included by every header, so that a project with an older language
/// setting reads one sentence instead of a page of template errors.
#pragma once

#define CFP_VERSION_MAJOR 0
#define CFP_VERSION_MINOR 1
#define CFP_VERSION_PATCH 0
#define CFP_VERSION_STRING "0.1.0"

#if defined(_MSVC_LANG)
#define CFP_CPLUSPLUS _MSVC_LANG
#else
#define CFP_CPLUSPLUS __cplusplus
#endif

#if CFP_CPLUSPLUS < 201703L
#error "cfp needs C++17: compile with -std=c++17 or newer (a -std=c++11 or -std=c++14 in CMAKE_CXX_FLAGS wins over CMake's own setting)."
#endif

#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#if defined(__GNUC__)
#pragma GCC warning "cfp: -ffinite-math-only (part of -ffast-math) removes the NaN checks that cfp's guarantees rest on; it is not supported."
#endif
#endif
