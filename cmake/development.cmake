# What only our own targets get: strict warnings and the default build type. Nothing here reaches a consumer.
if(cfp_is_top_level AND NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()

option(CFP_WARNINGS_AS_ERRORS "Treat warnings in cfp's own targets as errors" ON)
set(CFP_SANITIZE "" CACHE STRING "Sanitizers for cfp's own targets, for example address,undefined")

set(CFP_TEST_DATA "$ENV{CFP_TEST_DATA}" CACHE PATH "Folder of the real recordings; without it, the tests that need one are skipped")

add_library(cfp_development INTERFACE)
target_link_libraries(cfp_development INTERFACE cfp::cfp)
if(MSVC)
  target_compile_options(cfp_development INTERFACE /W4 /bigobj $<$<BOOL:${CFP_WARNINGS_AS_ERRORS}>:/WX>)
else()
  target_compile_options(cfp_development INTERFACE -Wall -Wextra -Wconversion -Wshadow $<$<BOOL:${CFP_WARNINGS_AS_ERRORS}>:-Werror>)
endif()
if(CFP_SANITIZE)
  target_compile_options(cfp_development INTERFACE -fsanitize=${CFP_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(cfp_development INTERFACE -fsanitize=${CFP_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)  # sees uninitialised members in std::regex once the code is instrumented
    target_compile_options(cfp_development INTERFACE -Wno-maybe-uninitialized)
  endif()
endif()
