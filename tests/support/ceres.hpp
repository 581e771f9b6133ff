// glog, which Ceres includes, has a CHECK of its own; Catch's, defined before or after, is the one that stays.
#pragma once

#pragma push_macro("CHECK")
#undef CHECK
#include <ceres/ceres.h>
#include <glog/logging.h>
#undef CHECK
#pragma pop_macro("CHECK")
