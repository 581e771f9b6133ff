// In the place of Pangolin, for machines without a screen: what the headers of ORB-SLAM2 name of it.
#pragma once

namespace pangolin {
struct OpenGlMatrix {};
inline void BindToContext(const char*) {}
}  // namespace pangolin
