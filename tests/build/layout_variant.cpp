// Compiled once per set of vector flags. Constants only: nothing here runs, so the flags need not suit the machine.
#include "layout_row.hpp"
#include "layout_structs.hpp"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Winvalid-offsetof"
#endif

namespace {

struct FollowsTheFlags {
  char first;
  Eigen::Matrix<double, 8, 1> last;
};

#define CFP_LAYOUT(type, last) {#type, sizeof(type), alignof(type), offsetof(type, last)},
#define CFP_LAYOUT_OPAQUE(...) {#__VA_ARGS__, sizeof(__VA_ARGS__), alignof(__VA_ARGS__), 0},
constexpr LayoutRow rows[] = {CFP_LAYOUT(FollowsTheFlags, last) CFP_LAYOUTS};

}  // namespace

#define CFP_LAYOUT_NAME_OF(variant) cfp_layout_##variant
#define CFP_LAYOUT_NAME(variant) CFP_LAYOUT_NAME_OF(variant)
extern const LayoutTable CFP_LAYOUT_NAME(CFP_LAYOUT_VARIANT);
constexpr LayoutTable CFP_LAYOUT_NAME(CFP_LAYOUT_VARIANT) = {rows, sizeof(rows) / sizeof(rows[0])};
