// What the loop tells about its work. It measures and writes nothing itself: clocks and recordings are observers.
#pragma once

#include "cfp/frame/static_probability.hpp"
#include "map.hpp"
#include "record.hpp"

// Compiled in integration/engines.cc alone.
extern template class cfp::StaticProbability<cfp_slam::Camera>;

namespace cfp_slam {

class Observer {
 public:
  virtual ~Observer() = default;
  // A module's work on a frame, or a part of it: both are called on the thread that does it, never by two at a time for
  // one module.
  virtual void begin(Module) {}
  virtual void end(Module) {}
  // A stage (report.stage) has given its weights; the frame has M of before.
  virtual void weighted(const cfp::StageResult<float>&, const cfp::FrameState<float>&, const Frame&) {}
  // The frame has its last pose, if any, and the map points that it rests on; nothing has learnt of it yet.
  virtual void decided(const cfp::StaticProbability<Camera>&, const Frame&, const Map&) {}
  virtual void finished(const FrameRecord&) {}
};

// A module's work from here to the end of the scope.
class Part {
 public:
  Part(Observer& observer, Module module) : observer_(observer), module_(module) { observer_.begin(module_); }
  ~Part() { observer_.end(module_); }
  Part(const Part&) = delete;
  Part& operator=(const Part&) = delete;

 private:
  Observer& observer_;
  Module module_;
};

}  // namespace cfp_slam
