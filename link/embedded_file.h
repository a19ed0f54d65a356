// The bytes of a file of the source tree, as a part of the program, with a zero behind them. The build names the file by a
// definition, and compiles the source again when the file changes (harness/report/CMakeLists.txt).
//
//   TILTPROOF_EMBED(page_template, TILTPROOF_PAGE_FILE)
//
// at the top of a source; the macro TILTPROOF_EMBEDDED(page_template) is then a std::string_view of the bytes.
#pragma once

#include <cstddef>
#include <string_view>

#define TILTPROOF_EMBED(symbol, file)                                              \
  asm(".section .rodata\n.balign 16\n" #symbol ":\n.incbin \"" file "\"\n" #symbol \
      "_end:\n.byte 0\n"                                                           \
      ".previous\n");                                                              \
  extern "C" {                                                                     \
  extern const char symbol[];                                                      \
  extern const char symbol##_end[];                                                \
  }
#define TILTPROOF_EMBEDDED(symbol) std::string_view(symbol, static_cast<std::size_t>(symbol##_end - symbol))
