#define CFP_TEST_INSTANCE template
#include "support/frame_engines.hpp"
