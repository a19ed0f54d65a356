#include "harness/report/report_page.h"
#include "link/check.h"
#include "link/embedded_file.h"

// The built page.
TILTPROOF_EMBED(tiltproof_page_template, TILTPROOF_PAGE_FILE)

namespace tiltproof::harness {

std::string_view PageTemplate() {
  const std::string_view page = TILTPROOF_EMBEDDED(tiltproof_page_template);
  Check(page.find(kDataPlace) != std::string_view::npos, "the page has a place for its data");
  return page;
}

}  // namespace tiltproof::harness
