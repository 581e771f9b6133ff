// The variants by the names that a command line takes.
#pragma once

#include <stdexcept>
#include <string>

#include "cfp/frame/frame_options.hpp"

namespace cfp_examples {

inline const std::string all_variants = "plain,only-boxes,no-ksp,no-posterior,no-dbscan,no-mdc,cfp-minus,cfp";

// Throws for a name that is none.
inline cfp::Variant variant_of(const std::string& name) {
  for (int v = 0; v <= static_cast<int>(cfp::Variant::plain); ++v) {
    if (name == cfp::to_string(static_cast<cfp::Variant>(v))) return static_cast<cfp::Variant>(v);
  }
  throw std::runtime_error("no variant '" + name + "': " + all_variants);
}

}  // namespace cfp_examples
