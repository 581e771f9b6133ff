#include <cstdio>
#include <initializer_list>

#include "layout_row.hpp"

extern const LayoutTable cfp_layout_sse2, cfp_layout_avx2, cfp_layout_avx512, cfp_layout_scalar, cfp_layout_unaligned;

int main() {
  const LayoutTable& reference = cfp_layout_sse2;
  bool control_moved = false;
  int differences = 0;
  for (const LayoutTable* variant : {&cfp_layout_avx2, &cfp_layout_avx512, &cfp_layout_scalar, &cfp_layout_unaligned}) {
    for (std::size_t i = 0; i < reference.size; ++i) {
      const LayoutRow& a = reference.rows[i];
      const LayoutRow& b = variant->rows[i];
      const bool same = a.size == b.size && a.alignment == b.alignment && a.last_offset == b.last_offset;
      if (i == 0) {
        control_moved |= !same;
      } else if (!same) {
        ++differences;
        std::printf("%s: size %zu, alignment %zu, last member at %zu; with other flags %zu, %zu, %zu\n", a.type, a.size,
                    a.alignment, a.last_offset, b.size, b.alignment, b.last_offset);
      }
    }
  }
  if (!control_moved) std::printf("the flags changed nothing, not even a type that must follow them\n");
  std::printf("%zu types compared, %d differences\n", reference.size - 1, differences);
  return differences == 0 && control_moved ? 0 : 1;
}
