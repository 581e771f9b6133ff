#pragma once

#include <cstddef>

/// Size, alignment and the offset of the last member of one type, as one set of compiler flags sees them.
struct LayoutRow {
  const char* type;
  std::size_t size, alignment, last_offset;
};

/// The rows of one variant; the first is a control whose alignment does follow the flags.
struct LayoutTable {
  const LayoutRow* rows;
  std::size_t size;
};
