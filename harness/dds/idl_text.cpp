#include "harness/dds/cdr.h"

// The file as it is in the source tree, with a zero behind it.
asm(R"(
  .section .rodata
tiltproof_idl_text:
  .incbin ")" TILTPROOF_IDL_FILE R"("
tiltproof_idl_text_end:
  .byte 0
  .previous
)");
extern "C" {
extern const char idl_text_begin[] __asm__("tiltproof_idl_text");
extern const char idl_text_end[] __asm__("tiltproof_idl_text_end");
}

namespace tiltproof::dds {

std::string_view IdlText() {
  return {idl_text_begin, static_cast<std::size_t>(idl_text_end - idl_text_begin)};
}

}  // namespace tiltproof::dds
