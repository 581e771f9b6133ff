#define CFP_TEST_INSTANCE template
#include "support/engines.hpp"
