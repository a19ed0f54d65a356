# The codec runs on a board without heap, exceptions or standard library: every symbol that its archive needs must be defined in
# it, or be one of the four functions that a freestanding compiler may call on its own. A list of what is allowed, not of what is
# forbidden: operator new, __cxa_throw, std::ios_base and the like are all refused.
#
#   cmake -DNM=nm -DARCHIVE=liblink_codec.a -P codec_symbols_test.cmake
set(allowed memcpy memmove memset memcmp _GLOBAL_OFFSET_TABLE_)

function(symbols result option)
  execute_process(COMMAND ${NM} ${option} --format=posix ${ARCHIVE} OUTPUT_VARIABLE output RESULT_VARIABLE code)
  if(code)
    message(FATAL_ERROR "${NM} cannot read ${ARCHIVE}")
  endif()
  string(REGEX MATCHALL "[^\n]+" lines "${output}")
  set(names "")
  foreach(line IN LISTS lines)
    if(line MATCHES "^([^ ]+) [A-Za-z]( |$)")
      list(APPEND names "${CMAKE_MATCH_1}")
    endif()
  endforeach()
  set(${result} "${names}" PARENT_SCOPE)
endfunction()

symbols(defined --defined-only)
symbols(needed --undefined-only)
if(NOT defined MATCHES "FrameDecoder")
  message(FATAL_ERROR "${ARCHIVE} does not hold the decoder: wrong archive, or unreadable output of ${NM}")
endif()
list(REMOVE_ITEM needed ${defined} ${allowed})
list(REMOVE_DUPLICATES needed)
if(needed)
  list(JOIN needed "\n  " text)
  message(FATAL_ERROR "the codec needs symbols from outside:\n  ${text}")
endif()
