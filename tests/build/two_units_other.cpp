#include "cfp/cfp.hpp"

const void* address_in_other_unit() noexcept;
const void* address_in_other_unit() noexcept { return &cfp::pi<double>; }
