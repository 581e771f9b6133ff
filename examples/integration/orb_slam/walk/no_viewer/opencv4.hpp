// What ORB-SLAM2 of 2017 found by way of OpenCV 2 and its C library.
#pragma once

#include <unistd.h>

#include <opencv2/core/core_c.h>
#include <opencv2/imgproc/types_c.h>
#include <opencv2/opencv.hpp>
