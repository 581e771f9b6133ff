/// @file assert.hpp
/// CFP_ASSERT: programmer errors only (two arrays of different length, a null view, unsorted input where sorted is
/// required). Never used for bad data, which gets a status. On in debug builds; define CFP_ASSERT yourself, before the
/// first cfp header and equally in every unit of a program, to route it elsewhere.
#pragma once

#include "cfp/version.hpp"

#ifndef CFP_ASSERT
#include <cassert>
#define CFP_ASSERT(condition) assert(condition)
#endif
