# Install rules, the package configuration for find_package(cfp), and the same export from the build tree, so that a
# project that adds cfp as a sub-directory can export its own targets.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(cfp_package_dir "${CMAKE_INSTALL_DATADIR}/cmake/cfp")
install(DIRECTORY include/cfp include/cfp_testing DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" FILES_MATCHING PATTERN "*.hpp")
install(FILES LICENSE DESTINATION "${CMAKE_INSTALL_DATADIR}/licenses/cfp")
install(TARGETS cfp EXPORT cfp_targets INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
install(EXPORT cfp_targets NAMESPACE cfp:: FILE cfpTargets.cmake DESTINATION "${cfp_package_dir}")
export(EXPORT cfp_targets NAMESPACE cfp:: FILE "${PROJECT_BINARY_DIR}/cfpTargets.cmake")

write_basic_package_version_file("${PROJECT_BINARY_DIR}/cfpConfigVersion.cmake" COMPATIBILITY SameMinorVersion ARCH_INDEPENDENT)
configure_file(cmake/cfpConfig.cmake.in "${PROJECT_BINARY_DIR}/cfpConfig.cmake" @ONLY)
install(FILES "${PROJECT_BINARY_DIR}/cfpConfig.cmake" "${PROJECT_BINARY_DIR}/cfpConfigVersion.cmake" DESTINATION "${cfp_package_dir}")

# For build systems without CMake: `pkg-config --cflags cfp`. Relative to itself, so that the tree may be moved.
configure_file(cmake/cfp.pc.in "${PROJECT_BINARY_DIR}/cfp.pc" @ONLY)
install(FILES "${PROJECT_BINARY_DIR}/cfp.pc" DESTINATION "${CMAKE_INSTALL_DATADIR}/pkgconfig")

# `cpack -G DEB` in a build tree makes libcfp-dev_<version>_all.deb, `cpack -G TGZ` an archive.
if(cfp_is_top_level)
  set(CPACK_GENERATOR TGZ)
  set(CPACK_PACKAGE_NAME libcfp-dev)
  set(CPACK_PACKAGE_CONTACT "The cfp authors <maintainers@users.noreply.h-seed-8525ea97.example>")
  set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
  set(CPACK_RESOURCE_FILE_LICENSE "${PROJECT_SOURCE_DIR}/LICENSE")
  set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
  set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
  set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE all)
  set(CPACK_DEBIAN_PACKAGE_SECTION libdevel)
  set(CPACK_DEBIAN_PACKAGE_DEPENDS "libeigen3-dev (>= 3.4)")
  include(CPack)
endif()
