# A stand-in for a newer Eigen's package: the version file refuses 3.x as Eigen 5's does, the headers are the installed ones.
if(NOT TARGET Eigen3::Eigen)
  add_library(Eigen3::Eigen INTERFACE IMPORTED)
  set_target_properties(Eigen3::Eigen PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${CFP_TEST_EIGEN_INCLUDE}")
endif()
