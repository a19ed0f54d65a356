#include "harness/dds/cdr.h"
#include "link/embedded_file.h"

TILTPROOF_EMBED(tiltproof_idl_text, TILTPROOF_IDL_FILE)

namespace tiltproof::dds {

std::string_view IdlText() { return TILTPROOF_EMBEDDED(tiltproof_idl_text); }

}  // namespace tiltproof::dds
