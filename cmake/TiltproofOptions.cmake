# Build options, and the compile flags every target of ours shares.

option(TILTPROOF_BUILD_TESTS "Build the tests" ON)
option(TILTPROOF_BUILD_BENCHMARKS "Build the benchmarks (needs Google Benchmark)" ON)
option(TILTPROOF_FUZZ "Build the libFuzzer targets (needs clang)" OFF)
set(TILTPROOF_FUZZ_ENGINE "-fsanitize=fuzzer" CACHE STRING "What links a fuzz target to its engine; OSS-Fuzz brings its own")
set(TILTPROOF_SANITIZE "" CACHE STRING "Value for -fsanitize=, for example address,undefined")

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_C_STANDARD 11)
set(CMAKE_C_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

# When they are installed: a compiler cache, and a linker that takes a tenth of the time.
find_program(TILTPROOF_CCACHE ccache)
if(TILTPROOF_CCACHE AND NOT DEFINED CMAKE_CXX_COMPILER_LAUNCHER)
  # It takes precompiled headers only where it is told that their dates do not count.
  set(CMAKE_C_COMPILER_LAUNCHER ${TILTPROOF_CCACHE})
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${TILTPROOF_CCACHE})
endif()
find_program(TILTPROOF_MOLD mold)
find_program(TILTPROOF_LLD ld.lld)
find_program(TILTPROOF_GOLD ld.gold)
if(TILTPROOF_MOLD)
  add_link_options(-fuse-ld=mold)
elseif(CMAKE_BUILD_TYPE STREQUAL "Debug" AND NOT TILTPROOF_SANITIZE)
  # The default takes two to four times as long for debug information.
  if(TILTPROOF_LLD)
    add_link_options(-fuse-ld=lld)
  elseif(TILTPROOF_GOLD)
    add_link_options(-fuse-ld=gold)
  endif()
endif()

# Replays must give the same bits on every build of one source: no contraction of a*b+c, no fast-math, no -march=native.
add_compile_options(-ffp-contract=off)
add_compile_options(-Wall -Wextra -Wpedantic -Wshadow -Wconversion)
# Messages name sources as the repository does, wherever it was built.
add_compile_options(-fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=)
add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor> $<$<COMPILE_LANGUAGE:CXX>:-Woverloaded-virtual>)

if(CMAKE_UNITY_BUILD)
  # A source that is included looks like a header, whose types must not have parts of unnamed namespaces.
  add_compile_options($<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-subobject-linkage>)
endif()

# GCC gives memory back between functions, which takes an eighth of the time of a large unit; it may take 1 GiB first.
add_compile_options($<$<COMPILE_LANG_AND_ID:CXX,GNU>:--param=ggc-min-heapsize=1048576>)

if(TILTPROOF_SANITIZE)
  add_compile_options(-fsanitize=${TILTPROOF_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${TILTPROOF_SANITIZE})
  add_compile_definitions(TILTPROOF_SANITIZED)
  # They double the code, and nothing here casts to other types. The address sanitizer finds null pointers.
  if(TILTPROOF_SANITIZE MATCHES undefined)
    add_compile_options(-fno-sanitize=null,vptr,object-size)
  endif()
  if(TILTPROOF_SANITIZE STREQUAL thread)
    # The thread sanitizer does not know fences; Asio's queues have locks beside them.
    add_compile_definitions(BOOST_ASIO_DISABLE_FENCED_BLOCK)
  endif()
endif()

if(TILTPROOF_FUZZ AND TILTPROOF_SANITIZE)
  # Everything tells the engine what it has reached. Builds with a sanitizer have this flag, too.
  add_compile_options(-fsanitize=fuzzer-no-link)
endif()

include_directories(${PROJECT_SOURCE_DIR})

# tiltproof_test(NAME tier SOURCES... [LIBS...] [COST s]): the tests of one folder, one GoogleTest program; tier is its CTest label.
# CTest runs a program as a whole: one process for each test would take longer to start than most tests take. COST is about how long
# it takes: the longest begin first. Tests are compiled more often than they are run: without optimisation, but for OPTIMISED ones, which
# compute. Of these a sanitizer watches the libraries that they test, and not what computes the right answer: that takes twice as long.
function(tiltproof_test name tier)
  cmake_parse_arguments(ARG "OPTIMISED" "COST" "SOURCES;LIBS;DEFINITIONS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBS} GTest::gtest_main GTest::gmock)
  target_compile_definitions(${name} PRIVATE TILTPROOF_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
                             TILTPROOF_BINARY_DIR="${PROJECT_BINARY_DIR}" ${ARG_DEFINITIONS})
  target_compile_options(${name} PRIVATE $<IF:$<BOOL:${ARG_OPTIMISED}>,-O1,-O0>)
  if(ARG_OPTIMISED AND TILTPROOF_SANITIZE)
    target_compile_options(${name} PRIVATE -fno-sanitize=all)
  endif()
  if(ARG_OPTIMISED)
    use_precompiled_headers(headers_tests_optimised ${name})
  else()
    use_precompiled_headers(headers_tests ${name})
  endif()
  add_test(NAME ${name} COMMAND ${name} --gtest_brief=1)
  set_tests_properties(${name} PROPERTIES LABELS ${tier} TIMEOUT 600)
  if(rapidcheck IN_LIST ARG_LIBS) # the same cases in every run
    set_tests_properties(${name} PROPERTIES ENVIRONMENT RC_PARAMS=seed=1)
  endif()
  if(ARG_COST)
    set_tests_properties(${name} PROPERTIES COST ${ARG_COST})
  endif()
endfunction()
