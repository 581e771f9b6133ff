# Install rules, the package configuration for find_package(cfp), and the same export from the build tree, so that a
# project that adds cfp as a sub-directory can export its own targets.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(cfp_package_dir "${CMAKE_INSTALL_DATADIR}/cmake/cfp")
install(DIRECTORY include/cfp DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" FILES_MATCHING PATTERN "*.hpp")
install(FILES LICENSE DESTINATION "${CMAKE_INSTALL_DATADIR}/licenses/cfp")
install(TARGETS cfp EXPORT cfp_targets INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
install(EXPORT cfp_targets NAMESPACE cfp:: FILE cfpTargets.cmake DESTINATION "${cfp_package_dir}")
export(EXPORT cfp_targets NAMESPACE cfp:: FILE "${PROJECT_BINARY_DIR}/cfpTargets.cmake")

write_basic_package_version_file("${PROJECT_BINARY_DIR}/cfpConfigVersion.cmake" COMPATIBILITY SameMinorVersion ARCH_INDEPENDENT)
configure_file(cmake/cfpConfig.cmake.in "${PROJECT_BINARY_DIR}/cfpConfig.cmake" @ONLY)
install(FILES "${PROJECT_BINARY_DIR}/cfpConfig.cmake" "${PROJECT_BINARY_DIR}/cfpConfigVersion.cmake" DESTINATION "${cfp_package_dir}")
