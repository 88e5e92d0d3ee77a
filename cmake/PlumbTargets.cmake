# Flags shared by every first-party target; never exported to users.
add_library(plumb_flags INTERFACE)
target_compile_features(plumb_flags INTERFACE cxx_std_20)
target_compile_options(plumb_flags INTERFACE
  # GCC 12 finds overlaps in string concatenation that are not there (GCC bug 105651).
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<VERSION_LESS:$<CXX_COMPILER_VERSION>,13>>:-Wno-restrict>
  $<$<CXX_COMPILER_ID:GNU,Clang>:-Wall -Wextra -Wpedantic -Wshadow $<$<COMPILE_LANGUAGE:CXX>:-Wconversion -Wno-sign-conversion>>
  $<$<BOOL:${PLUMB_WERROR}>:-Werror>)
if(PLUMB_SANITIZE)  # Directory-wide: every object in a process must agree on it.
  add_compile_options(-fsanitize=${PLUMB_SANITIZE} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${PLUMB_SANITIZE})
  # They make GCC see uses of what is not initialized in std::optional.
  target_compile_options(plumb_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
endif()

# plumb_add_module(geometry SOURCES a.cc HEADERS a.h PUBLIC plumb::base PRIVATE Ceres::ceres)
# Defines plumb_geometry and the alias plumb::geometry. PUBLIC/PRIVATE are the only way to gain a
# dependency, so this call is the module's entry in the layer diagram.
function(plumb_add_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;HEADERS;PUBLIC;PRIVATE" ${ARGN})
  if(ARG_SOURCES)
    add_library(plumb_${name} STATIC ${ARG_SOURCES})
    set(scope PUBLIC)
    target_link_libraries(plumb_${name} PRIVATE $<BUILD_INTERFACE:plumb_flags> ${ARG_PRIVATE})
  else()
    add_library(plumb_${name} INTERFACE)
    set(scope INTERFACE)
  endif()
  add_library(plumb::${name} ALIAS plumb_${name})
  target_compile_features(plumb_${name} ${scope} cxx_std_20)
  target_link_libraries(plumb_${name} ${scope} ${ARG_PUBLIC})
  target_include_directories(plumb_${name} ${scope} ${PROJECT_SOURCE_DIR}/src)
  target_sources(plumb_${name} PRIVATE ${ARG_HEADERS})
endfunction()

# plumb_add_test(refine/segment_reprojection DEPS plumb::refine LABELS unit)
# Builds tests/<path>_test.cc and registers it as ctest "<path>" (GoogleTest, any number of cases).
function(plumb_add_test path)
  cmake_parse_arguments(ARG "" "" "DEPS;LABELS;SOURCES" ${ARGN})
  string(REPLACE "/" "_" target "test_${path}")
  add_executable(${target} ${PROJECT_SOURCE_DIR}/tests/${path}_test.cc ${ARG_SOURCES})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_link_libraries(${target} PRIVATE plumb_flags GTest::gtest GTest::gmock GTest::gtest_main ${ARG_DEPS})
  add_test(NAME ${path} COMMAND ${target} WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
  set_tests_properties(${path} PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT 600)
endfunction()
