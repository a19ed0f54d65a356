#include "harness/report/report_page.h"
#include "link/check.h"

// The built page as it is in the source tree, with a zero behind it.
asm(R"(
  .section .rodata
  .balign 16
tiltproof_page_template:
  .incbin ")" TILTPROOF_PAGE_FILE R"("
tiltproof_page_template_end:
  .byte 0
  .previous
)");
extern "C" {
extern const char page_template_begin[] __asm__("tiltproof_page_template");
extern const char page_template_end[] __asm__("tiltproof_page_template_end");
}

namespace tiltproof::harness {

std::string_view PageTemplate() {
  const std::string_view page(page_template_begin,
                              static_cast<std::size_t>(page_template_end - page_template_begin));
  Check(page.find(kDataPlace) != std::string_view::npos, "the page has a place for its data");
  return page;
}

}  // namespace tiltproof::harness
