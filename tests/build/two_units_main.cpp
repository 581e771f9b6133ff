// The same header in two units of one program: a function that lacks `inline` fails to link.
#include "cfp/cfp.hpp"

const void* address_in_other_unit() noexcept;
std::size_t instantiated_templates() noexcept;

int main() {
  const bool one_definition = address_in_other_unit() == static_cast<const void*>(&cfp::pi<double>);
  return one_definition && instantiated_templates() > 0 ? 0 : 1;
}
