#include "harness/report/report_page.h"
#include "link/check.h"
#include "link/embedded_file.h"

// The built pages.
TILTPROOF_EMBED(tiltproof_report_page, TILTPROOF_REPORT_PAGE_FILE)
TILTPROOF_EMBED(tiltproof_envelope_page, TILTPROOF_ENVELOPE_PAGE_FILE)
TILTPROOF_EMBED(tiltproof_campaign_page, TILTPROOF_CAMPAIGN_PAGE_FILE)
TILTPROOF_EMBED(tiltproof_integrity_page, TILTPROOF_INTEGRITY_PAGE_FILE)

namespace tiltproof::harness {
namespace {

std::string_view Checked(std::string_view page) {
  Check(page.find(kDataPlace) != std::string_view::npos, "a page has a place for its data");
  return page;
}

}  // namespace

std::string_view PageTemplate() { return Checked(TILTPROOF_EMBEDDED(tiltproof_report_page)); }
std::string_view EnvelopePageTemplate() { return Checked(TILTPROOF_EMBEDDED(tiltproof_envelope_page)); }
std::string_view CampaignPageTemplate() { return Checked(TILTPROOF_EMBEDDED(tiltproof_campaign_page)); }
std::string_view IntegrityPageTemplate() { return Checked(TILTPROOF_EMBEDDED(tiltproof_integrity_page)); }

std::string PageWith(std::string_view page, const std::string& data) {
  const std::size_t place = page.find(kDataPlace);
  std::string html(page.substr(0, place));
  html += data;
  html += page.substr(place + kDataPlace.size());
  return html;
}

}  // namespace tiltproof::harness
