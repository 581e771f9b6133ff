// In the place of ORB-SLAM2's Viewer.cc and MapDrawer.cc: nothing is drawn. The viewer is never made (System's
// bUseViewer is false); Tracking tells the map drawer its poses in any case.
#include "MapDrawer.h"
#include "Viewer.h"

namespace ORB_SLAM2 {

MapDrawer::MapDrawer(Map* map, const string&) : mpMap(map) {}
void MapDrawer::SetCurrentCameraPose(const cv::Mat&) {}

Viewer::Viewer(System*, FrameDrawer*, MapDrawer*, Tracking*, const string&) {}
void Viewer::Run() {}
void Viewer::RequestFinish() {}
void Viewer::RequestStop() {}
bool Viewer::isFinished() { return true; }
bool Viewer::isStopped() { return true; }
void Viewer::Release() {}

}  // namespace ORB_SLAM2
