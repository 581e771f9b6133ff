"""Where ORB-SLAM2 and ORB-SLAM3 change, for apply.py: the numbers are those of the steps in README.md.

A place is a step, a file, a function ("" for the whole file), a regular expression, what takes its place, and how many
times it is found there. Those of one system come before those of both, in the order in which they are made.
"""
from pathlib import Path

HERE = Path(__file__).resolve().parent
GUARD = "if(mpStaticWeights) "
OPTIMIZER = "src/Optimizer.cc"


def new_frame(depth):
    return (r"if(mpStaticWeights)\n    {\n        mpStaticWeights->NewFrame(mCurrentFrame,mDetections,mFlow.Next("
            r"mImGray," + depth + r",mCurrentFrame.mvKeys,mpStaticWeights->Probability().state()));\n"
            r"        mDetections.reset();\n    }\n\n    \1")


def reset(before):
    return (before, r"if(mpStaticWeights)\n    {\n        mpStaticWeights->Reset();\n        mFlow.Reset();\n    }\n\n    \1", 1)


def weighted(step, function, edges):
    """The information and the kernels of edges whose weight is w."""
    return [(step, OPTIMIZER, function, r"Identity\(\) ?\* ?invSigma2", r"Identity()*(w*invSigma2)", edges),
            (step, OPTIMIZER, function, r"setDelta\(((?:delta|thHuber)\w+)\)", r"setDelta(\1*sqrt(w))", edges)]


def weighted_points(step, function, kinds, edges):
    """A bundle adjustment: the edges of each kind with M of their points, which is kept beside them."""
    return [(step, OPTIMIZER, function, r"(\n    vector<MapPoint\*> vpMapPointEdgeMono;)",
             r"\n    vector<float> " + ", ".join("vWeight" + kind for kind in kinds) + r";\1", 1),
            (step, OPTIMIZER, function, r"(\n[ \t]*)(g2o::VertexSBAPointXYZ\* vPoint = new)",
             r"\1const float w = max(pMP->mStaticProbability.load(),0.01f);  // read once: tracking goes on learning\1\2", 1),
            *weighted(step, function, edges),
            (step, OPTIMIZER, function, r"(\n[ \t]*)(vpEdges(" + "|".join(kinds) + r")\.push_back\(e\);)",
             r"\1\2\1vWeight\3.push_back(w);", edges)]


def without_dynamic_points(step, function, times):
    """A bundle adjustment that takes no points of M = 0."""
    return (step, OPTIMIZER, function, r"if\(!pMP->isBad\(\)([^\n]*\)\n[\s{]*if\(pMP->mnBALocalForKF)",
            r"if(!pMP->isBad() && pMP->mStaticProbability>0\1", times)


def adapter(host, camera):
    """Step 2 in Tracking.h: what the host is called, and what of Tracking tells its camera."""
    return (2, "include/Tracking.h", "", r"(\nclass Tracking\s*\n\{\s*\n\s*public:)",
            r"\ntypedef cfp_integration::StaticWeights<cfp_integration::" + host + r"<Frame> > StaticWeights;\n\1"
            r"\n    // cfp\n    void UseStaticWeights(const cfp::FrameOptions &options)\n    {\n"
            r"        const auto camera = cfp_integration::" + host + r"<Frame>::CameraOf(" + camera + r");\n"
            r"        if(camera)\n            mpStaticWeights.reset(new StaticWeights(*camera,options));\n        else\n"
            r'            std::cerr << "cfp: this camera is not supported, static weights are off" << std::endl;' r"\n    }\n"
            r"    std::optional<std::vector<cfp::Detection<float> > > mDetections;  // of the next image\n"
            r"    std::unique_ptr<StaticWeights> mpStaticWeights;\n    cfp_integration::FrameFlow mFlow;\n"
            r"    int PoseOptimization();\n"
            r"    bool MayCreate(int i) const { return !mpStaticWeights || "
            r"mpStaticWeights->MayCreate(mCurrentFrame.mvStaticProbability[i]); }\n"
            r"    float InitialM(const Frame &F, int i) const { return mpStaticWeights ? F.mvStaticProbability[i] : 1.0f; }\n"
            r"    bool Counts(int i) const { return !mpStaticWeights || mpStaticWeights->CountsAsInlier(mCurrentFrame,i); }\n", 1)


LOCAL_BA = "Optimizer::LocalBundleAdjustment(KeyFrame *pKF, bool"
TAKE_PART = (r"\1\2const float w = Weight(pFrame,i);\2if(!(w>0))\2{\2"
             r"    pFrame->mvbOutlier[i] = false;\2    continue;\2}\n")

ORB_SLAM2 = [
    (0, "CMakeLists.txt", "", r"find_package\(OpenCV 3\.0 QUIET\)", "find_package(OpenCV QUIET)", 1),
    (0, "Thirdparty/DBoW2/CMakeLists.txt", "", r"find_package\(OpenCV 3\.0 QUIET\)", "find_package(OpenCV QUIET)", 1),
    # what C++17, OpenCV 4 and a newer C library want of the code of 2017, nothing where a fork has done it
    (0, "include/ORBextractor.h", "", r"#include\s*<(?:opencv/cv\.h|opencv2/opencv\.hpp)>",
     "#include <unistd.h>\n#include <opencv2/core/core_c.h>\n#include <opencv2/imgproc/types_c.h>\n"
     "#include <opencv2/opencv.hpp>\n#if __has_include(<opencv2/imgcodecs/legacy/constants_c.h>)\n"
     "#include <opencv2/imgcodecs/legacy/constants_c.h>\n#endif", 1),
    (0, "include/LoopClosing.h", "", r"std::pair<(?:const KeyFrame\*|KeyFrame\* ?const), ?g2o::Sim3>",
     "std::pair<KeyFrame* const, g2o::Sim3>", 1),
    adapter("OrbSlam2", "mK,mDistCoef"),
    (4, "src/Tracking.cc", "Tracking::StereoInitialization()", r"(new MapPoint\(x3D,pKFini,mpMap\);)",
     r"\1\n                pNewMP->mStaticProbability = InitialM(mCurrentFrame,i);", 1),
    (5, "src/Tracking.cc", "", r"Optimizer::PoseOptimization\(&mCurrentFrame\)", "PoseOptimization()", 6),
    (5, OPTIMIZER, "Optimizer::PoseOptimization(", r"if\(chi2>(chi2\w+\[it\])\)",
     r"if(chi2>\1*Weight(pFrame,idx))", 2),
    *weighted(5, "Optimizer::PoseOptimization(", 2),
    *weighted_points(11, LOCAL_BA, ["Mono", "Stereo"], 2),
    (11, OPTIMIZER, LOCAL_BA, r"e->chi2\(\)>5\.991", "e->chi2()>5.991*vWeightMono[i]", 2),
    (11, OPTIMIZER, LOCAL_BA, r"e->chi2\(\)>7\.815", "e->chi2()>7.815*vWeightStereo[i]", 2),
]

INERTIAL = [f"Optimizer::PoseInertialOptimizationLast{last}(" for last in ("KeyFrame", "Frame")]
INERTIAL_BA = "Optimizer::LocalInertialBA(KeyFrame *pKF"

ORB_SLAM3 = [
    adapter("OrbSlam3", "mpCamera,mpCamera2,mK,mDistCoef"),
    *[(2, "src/Tracking.cc", function, *reset(r"(mvIniMatches\.clear\(\);)"))
      for function in ("Tracking::ResetActiveMap(", "Tracking::CreateMapInAtlas()")],
    (4, "src/Tracking.cc", "Tracking::StereoInitialization()", r"(\n[ \t]*)(MapPoint\* pNewMP = new MapPoint[^\n]*)",
     r"\1\2\1pNewMP->mStaticProbability = InitialM(mCurrentFrame,i);", 2),
    (5, "src/Tracking.cc", "", r"Optimizer::PoseOptimization\(&mCurrentFrame\)", "PoseOptimization()", 7),
    (5, "src/Tracking.cc", "Tracking::TrackLocalMap()", r"(\n[ \t]*)(inliers = Optimizer::PoseInertial)",
     r"\1" + GUARD + r"mpStaticWeights->Weigh(mCurrentFrame);\1\2", 2),
    (5, OPTIMIZER, "Optimizer::PoseOptimization(", r"if\(chi2>(chi2\w+\[it\])\)",
     r"if(chi2>\1*Weight(pFrame,idx))", 3),
    *weighted(5, "Optimizer::PoseOptimization(", 4),
    *weighted_points(11, LOCAL_BA, ["Mono", "Body", "Stereo"], 3),
    (11, OPTIMIZER, LOCAL_BA, r"(= vpEdges(\w+)\[i\];[^}]*?e->chi2\(\)>[\d.]+)", r"\1*vWeight\2[i]", 3),
    # 12: the same with an IMU
    *[step for function in INERTIAL for step in [
        (12, OPTIMIZER, function, r"(\n            if\(pMP\)\n            \{)(\n                )", TAKE_PART + r"\2", 1),
        *weighted(12, function, 3),
        (12, OPTIMIZER, function, r"chi2>(chi2(?:\w+\[it\]|close))", r"chi2>\1*Weight(pFrame,idx)", 3),
        (12, OPTIMIZER, function, r"chi2\(\)<(chi2\w+Out)", r"chi2()<\1*Weight(pFrame,idx)", 2)]],
    without_dynamic_points(12, INERTIAL_BA, 2),
    *weighted_points(12, INERTIAL_BA, ["Mono", "Stereo"], 3),
    (12, OPTIMIZER, INERTIAL_BA, r"chi2(Mono|Stereo)2( &&|\))", r"chi2\g<1>2*vWeight\1[i]\2", 3),
]

BOTH = [
    # 0: how it is built
    (0, "CMakeLists.txt", "", r"# Check C\+\+11[\s\S]*?\nendif\(\)\n",
     "set(CMAKE_CXX_STANDARD 17)\nadd_definitions(-DCOMPILEDWITHC11)\n", 1),
    (0, "CMakeLists.txt", "", r"(\ninclude_directories\(\n)",
     lambda found: f"{found[1]}{HERE.parents[2]}/include\n{HERE.parents[1]}\n{HERE}\n", 1),
    (0, "CMakeLists.txt", "", r"(src/System\.cc\n)", lambda found: f"{found[1]}{HERE.parent}/engines.cc\n", 1),
    (0, "include/LoopClosing.h", "", r"(?:bool|int) mnFullBAIdx;", "int mnFullBAIdx;", 1),
    # 1: what a frame, a keyframe and a map point hold, and their copies
    (1, "include/Frame.h", "", r"(std::vector<bool> mvbOutlier;)",
     r"\1\n    std::vector<float> mvStaticProbability, mvWeight;  // cfp: K, and the weights of the last optimisation", 1),
    (1, "src/Frame.cc", "Frame::Frame(const Frame &frame)", r"(if\((?:!frame\.mTcw\.empty\(\)|frame\.mbHasPose)\))",
     r"mvStaticProbability = frame.mvStaticProbability;\n    mvWeight = frame.mvWeight;\n\n    \1", 1),
    (1, "include/KeyFrame.h", "", r"(const std::vector<float> mvDepth;[^\n]*)",
     r"\1\n    std::vector<float> mvStaticProbability;  // cfp: K, never changed", 1),
    (1, "src/KeyFrame.cc", "KeyFrame::KeyFrame(Frame &F", r"(SetPose\(F\.(?:mTcw|GetPose\(\))\);)",
     r"mvStaticProbability = F.mvStaticProbability;\n    \1", 1),
    (1, "include/MapPoint.h", "", r"(#include\s*<mutex>)", r"#include<atomic>\n\1", 1),
    (1, "include/MapPoint.h", "", r"(int nObs;)",
     r"\1\n    std::atomic<float> mStaticProbability{1.0f};  // cfp: M, read by the mapping thread", 1),
    # 2: the adapter beside Tracking, and the door for the host's program
    (2, "include/Tracking.h", "", r"(#include\s*<mutex>)",
     r'#include<iostream>\n#include<memory>\n#include<optional>\n'
     r'#include"orb_slam.hpp"  // of cfp, examples/integration/orb_slam\n\n\1', 1),
    (2, "include/System.h", "", r"(#include\s*<string>)", r'#include"cfp/frame/frame_options.hpp"\n\1', 1),
    (2, "include/System.h", "", r"(\n    // Proccess the given monocular frame)",
     r"\n    // cfp: once, and the detections of every image before it is tracked (not at all: the detector did not run)"
     r"\n    void UseStaticWeights(const cfp::FrameOptions &options);"
     r"\n    void SetDetections(const std::vector<cfp::Detection<float> > &detections);\n\1", 1),
    (2, "src/System.cc", "", r"(\n(?:cv::Mat|Sophus::SE3f) System::TrackRGBD\()",
     r"\nvoid System::UseStaticWeights(const cfp::FrameOptions &options)\n{\n"
     r"    mpTracker->UseStaticWeights(options);\n}\n"
     r"\nvoid System::SetDetections(const std::vector<cfp::Detection<float> > &detections)\n{\n"
     r"    mpTracker->mDetections = detections;\n}\n\1", 1),
    (2, "src/Tracking.cc", "Tracking::Reset(", *reset(r"(mlRelativeFramePoses\.clear\(\);)")),
    # 3: a new frame
    (3, "src/Tracking.cc", "Tracking::GrabImageStereo", r"(Track\(\);)", new_frame("cv::Mat()"), 1),
    (3, "src/Tracking.cc", "Tracking::GrabImageMonocular", r"(Track\(\);)", new_frame("cv::Mat()"), 1),
    (3, "src/Tracking.cc", "Tracking::GrabImageRGBD", r"(Track\(\);)", new_frame("imDepth"), 1),
    # 4: initialisation
    (4, "src/Tracking.cc", "Tracking::StereoInitialization()", r"if\(z>0\)", "if(z>0 && MayCreate(i))", 1),
    (4, "src/Tracking.cc", "Tracking::MonocularInitialization()", r"(// Check if there are enough correspondences)",
     r"for(size_t i=0; mpStaticWeights && i<mvIniMatches.size(); i++)\n        {\n"
     r"            if(mvIniMatches[i]>=0 && !(MayCreate(mvIniMatches[i]) &&"
     r" mpStaticWeights->MayCreate(mInitialFrame.mvStaticProbability[i])))\n            {\n"
     r"                mvIniMatches[i]=-1;\n                nmatches--;\n            }\n        }\n\n        \1", 1),
    (4, "src/Tracking.cc", "Tracking::CreateInitialMapMonocular()", r"(new MapPoint\(worldPos,pKFcur,[^;]*;)",
     r"\1\n        pMP->mStaticProbability = InitialM(mCurrentFrame,mvIniMatches[i]);", 1),
    # 5: weights of every pose optimisation
    (5, "src/Tracking.cc", "", r"(\nbool Tracking::TrackReferenceKeyFrame\(\)\n)",
     r"\nint Tracking::PoseOptimization()\n{\n    " + GUARD + r"mpStaticWeights->Weigh(mCurrentFrame);\n"
     r"    return Optimizer::PoseOptimization(&mCurrentFrame);\n}\n\1", 1),
    (5, OPTIMIZER, "", r"(\nint Optimizer::PoseOptimization\(Frame \*pFrame\)\n)",
     r"\nstatic float Weight(const Frame *pFrame, size_t i)\n{\n"
     r"    return pFrame->mvWeight.empty() ? 1.0f : pFrame->mvWeight[i];\n}\n\1", 1),
    (5, OPTIMIZER, "Optimizer::PoseOptimization(", r"(\n        if\(pMP\)\n        \{)(\n            )",
     TAKE_PART + r"\2", 1),
    # 6: after the first pose
    (6, "src/Tracking.cc", "Tracking::Track()", r"(// If we have an initial estimation of the camera pose)",
     r"if(bOK && mpStaticWeights && mLastProcessedState==OK)\n"
     r"            mpStaticWeights->FirstPose(mCurrentFrame,mLastFrame);\n\n        \1", 1),
    (6, "src/Tracking.cc", "Tracking::TrackReferenceKeyFrame()", r"Observations\(\)>0\)", "Observations()>0 && Counts(i))", 1),
    (6, "src/Tracking.cc", "Tracking::TrackWithMotionModel()", r"Observations\(\)>0\)", "Observations()>0 && Counts(i))", 1),
    (6, "src/Tracking.cc", "Tracking::UpdateLastFrame()", r"(new MapPoint\(x3D,[^;]*;)",
     r"\1\n            pNewMP->mStaticProbability = InitialM(mLastFrame,i);", 1),
    # 7: relocalisation
    (7, "src/Tracking.cc", "Tracking::Relocalization()", r"(if\(nmatches<15\))",
     r"for(size_t j=0; mpStaticWeights && j<vvpMapPointMatches[i].size(); j++)\n            {\n"
     r"                MapPoint* &pMP = vvpMapPointMatches[i][j];\n"
     r"                if(pMP && !mpStaticWeights->Trusts(j,pMP->mStaticProbability))\n                {\n"
     r"                    pMP = static_cast<MapPoint*>(NULL);\n                    nmatches--;\n"
     r"                }\n            }\n            \1", 1),
    # 8: the local map
    (8, "src/Tracking.cc", "Tracking::TrackLocalMap()", r"(\n    mnMatchesInliers = 0;)",
     r"\n    " + GUARD + r"mpStaticWeights->Learn(mCurrentFrame);\n\1", 1),
    (8, "src/Tracking.cc", "Tracking::TrackLocalMap()", r"Observations\(\)>0\)", "Observations()>0 && Counts(i))", 1),
    # 9: keyframes and their points
    (9, "src/Tracking.cc", "Tracking::NeedNewKeyFrame()", r"mvDepth\[i\]<mThDepth\)", "mvDepth[i]<mThDepth && MayCreate(i))", 1),
    (9, "src/Tracking.cc", "Tracking::CreateNewKeyFrame()", r"(KeyFrame\* pKF = new KeyFrame)",
     r"for(int i=0; mpStaticWeights && i<mCurrentFrame.N; i++)\n    {\n"
     r"        if(mCurrentFrame.mvpMapPoints[i] && !Counts(i))\n"
     r"            mCurrentFrame.mvpMapPoints[i] = static_cast<MapPoint*>(NULL);\n    }\n\n    \1", 1),
    (9, "src/Tracking.cc", "Tracking::CreateNewKeyFrame()", r"if\(z>0\)", "if(z>0 && MayCreate(i))", 1),
    (9, "src/Tracking.cc", "Tracking::CreateNewKeyFrame()", r"(new MapPoint\(x3D,pKF,[^;]*;)",
     r"\1\n                    pNewMP->mStaticProbability = InitialM(mCurrentFrame,i);", 1),
    # 10: the mapping thread
    (10, "src/LocalMapping.cc", "LocalMapping::CreateNewMapPoints()", r"(\n[ \t]*)(const cv::KeyPoint &kp1 = [^\n]*)",
     r"\1const float K = mpCurrentKeyFrame->mvStaticProbability.empty() ? 1.0f :"
     r" min(mpCurrentKeyFrame->mvStaticProbability[idx1],pKF2->mvStaticProbability[idx2]);"
     r"\1if(K<0.3f)  // cfp::FrameOptions::min_creation_probability\1    continue;\n\1\2", 1),
    (10, "src/LocalMapping.cc", "LocalMapping::CreateNewMapPoints()", r"(new MapPoint\(x3D, ?mpCurrentKeyFrame,[^;]*;)",
     r"\1\n            pMP->mStaticProbability = K;", 1),
    (10, "src/MapPoint.cc", "MapPoint::Replace(", r"(pMP->IncreaseFound\(nfound\);)",
     r"const float found = pMP->GetFound();\n    pMP->mStaticProbability ="
     r" (found*pMP->mStaticProbability+nfound*mStaticProbability)/(found+nfound);\n    \1", 1),
    # 11: local bundle adjustment
    without_dynamic_points(11, LOCAL_BA, 1),
]
