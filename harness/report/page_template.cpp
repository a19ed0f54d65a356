#include "harness/report/report_page.h"
#include "link/check.h"

// The built pages as they are in the source tree, each with a zero behind it.
#define TILTPROOF_EMBED(NAME, FILE)                                                                    \
  asm(".section .rodata\n.balign 16\ntiltproof_" NAME "_begin:\n.incbin \"" FILE "\"\ntiltproof_" NAME \
      "_end:\n.byte 0\n.previous\n")

TILTPROOF_EMBED("report_page", TILTPROOF_REPORT_PAGE_FILE);
TILTPROOF_EMBED("envelope_page", TILTPROOF_ENVELOPE_PAGE_FILE);
extern "C" {
extern const char report_page_begin[] __asm__("tiltproof_report_page_begin");
extern const char report_page_end[] __asm__("tiltproof_report_page_end");
extern const char envelope_page_begin[] __asm__("tiltproof_envelope_page_begin");
extern const char envelope_page_end[] __asm__("tiltproof_envelope_page_end");
}

namespace tiltproof::harness {
namespace {

std::string_view Between(const char* begin, const char* end) {
  const std::string_view page(begin, static_cast<std::size_t>(end - begin));
  Check(page.find(kDataPlace) != std::string_view::npos, "a page has a place for its data");
  return page;
}

}  // namespace

std::string_view PageTemplate() { return Between(report_page_begin, report_page_end); }
std::string_view EnvelopePageTemplate() { return Between(envelope_page_begin, envelope_page_end); }

std::string PageWith(std::string_view page, const std::string& data) {
  const std::size_t place = page.find(kDataPlace);
  std::string html(page.substr(0, place));
  html += data;
  html += page.substr(place + kDataPlace.size());
  return html;
}

}  // namespace tiltproof::harness
