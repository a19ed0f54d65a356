# Headers of others, parsed once for all units that are compiled with the same options.
#
# A compiler takes a precompiled header only where options and macros are those that it was made with (-Winvalid-pch is an error), and GCC
# crashes at another -O. So there is one for each, and a source with an -O of its own has SKIP_PRECOMPILE_HEADERS. No header of ours is
# in them: a change in one compiles only what includes it.
#
#   headers                   libraries of the harness that link fmt, -O1; with a sanitizer all of it, -O0
#   headers_tests             tests, -O0
#   headers_tests_optimised   tests, -O1, without a sanitizer
#   headers_fuzz              libFuzzer targets
option(TILTPROOF_PRECOMPILE_HEADERS "Parse the headers of others once" ON)
if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND TILTPROOF_CCACHE)
  # A compiler cache does not take clang's.
  set(TILTPROOF_PRECOMPILE_HEADERS OFF)
endif()

set(standard_headers algorithm array charconv chrono cmath cstddef cstdint cstring deque filesystem fstream functional limits map memory
  numbers optional set span sstream stdexcept string string_view system_error utility variant vector)

# precompiled_headers(NAME OPTIONS... LIBS... HEADERS... [EXECUTABLE]): makes one of the standard headers and HEADERS.
function(precompiled_headers name)
  cmake_parse_arguments(ARG "EXECUTABLE" "" "OPTIONS;HEADERS;LIBS" ${ARGN})
  if(NOT TILTPROOF_PRECOMPILE_HEADERS)
    return()
  endif()
  set(source ${PROJECT_BINARY_DIR}/CMakeFiles/${name}.cpp)
  if(NOT EXISTS ${source})
    file(WRITE ${source} "int main() { return 0; }\n")
  endif()
  if(ARG_EXECUTABLE) # -fPIE, and a library has -fPIC
    add_executable(${name} EXCLUDE_FROM_ALL ${source})
  else()
    add_library(${name} OBJECT EXCLUDE_FROM_ALL ${source})
  endif()
  set_target_properties(${name} PROPERTIES UNITY_BUILD OFF)
  target_compile_options(${name} PRIVATE ${ARG_OPTIONS})
  target_link_libraries(${name} PRIVATE ${ARG_LIBS})
  list(TRANSFORM standard_headers PREPEND "<")
  list(TRANSFORM standard_headers APPEND ">")
  target_precompile_headers(${name} PRIVATE ${standard_headers} ${ARG_HEADERS})
endfunction()

# use_precompiled_headers(NAME TARGETS...)
function(use_precompiled_headers name)
  if(TARGET ${name})
    foreach(target ${ARGN})
      target_precompile_headers(${target} REUSE_FROM ${name})
    endforeach()
  endif()
endfunction()

find_package(fmt REQUIRED)
# With sanitizers most of the time goes into compiling: 40 % less without optimisation.
set(harness_optimisation $<$<CONFIG:Release>:-O1>)
if(TILTPROOF_SANITIZE)
  set(harness_optimisation -O0)
endif()
precompiled_headers(headers OPTIONS ${harness_optimisation} LIBS fmt::fmt HEADERS <fmt/format.h> <nlohmann/json.hpp>)
