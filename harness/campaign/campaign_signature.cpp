#include "harness/campaign/campaign_signature.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>

#include "harness/run/hash.h"

namespace tiltproof::harness {
namespace {

constexpr const char* kNoFault = "no_fault";
constexpr std::size_t kNameBytesMax = 80;

std::string ShortHash(std::string_view text) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(text.data());
  return fmt::format("{:08x}", Fnv1a({bytes, text.size()}) >> 32);
}

std::string FolderName(std::string_view text) {
  std::string name;
  for (const char c : text.substr(0, kNameBytesMax)) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                          c == '_' || c == '-' || (c == '.' && !name.empty());
    name += is_plain ? c : '_';
  }
  return name == text ? name : name + "-" + ShortHash(text);
}

}  // namespace

std::string SignatureText(std::string_view criterion, std::string_view end, std::vector<std::string> types) {
  std::sort(types.begin(), types.end());
  types.erase(std::unique(types.begin(), types.end()), types.end());
  std::string text = fmt::format("{}", fmt::join(types, "+"));
  if (types.empty()) text = kNoFault;
  if (types.size() > kTypesNamedMax) text = fmt::format("{}_types-{}", types.size(), ShortHash(text));
  return fmt::format("{},{},{}", FolderName(criterion), FolderName(end), text);
}

std::vector<std::string> TypesOf(std::string_view signature) {
  std::vector<std::string> types;
  signature.remove_prefix(std::min(signature.size(), signature.rfind(',') + 1));
  if (signature == kNoFault) return types;
  for (std::size_t begin = 0; begin <= signature.size();) {
    const std::size_t end = std::min(signature.find('+', begin), signature.size());
    types.emplace_back(signature.substr(begin, end - begin));
    begin = end + 1;
  }
  return types;
}

std::string FirstSignature(const CampaignRun& run) {
  if (run.verdict != "fail") return "";
  std::vector<std::string> active, acted;
  for (const CampaignFault& fault : run.faults) {
    if (fault.activations == 0 || (run.time_s && fault.start_s > *run.time_s)) continue;
    acted.push_back(fault.type);
    if (run.time_s && *run.time_s <= fault.end_s) active.push_back(fault.type);
  }
  return SignatureText(run.criterion, run.end, active.empty() ? acted : active);
}

std::vector<CampaignFailure> FinalFailures(std::span<const FirstFailure> failures) {
  // By first signature: the final ones, in the order of their first flight, and how many flights have each.
  std::map<std::string, std::vector<std::pair<std::string, std::size_t>>> finals;
  for (const FirstFailure& failure : failures) {
    if (!failure.minimised) continue;
    auto& known = finals[failure.first_signature];
    auto found = std::find_if(known.begin(), known.end(),
                              [&](const auto& entry) { return entry.first == failure.minimised->signature; });
    if (found == known.end()) found = known.insert(known.end(), {failure.minimised->signature, 0});
    ++found->second;
  }
  std::vector<CampaignFailure> result;
  for (const FirstFailure& failure : failures) {
    if (failure.minimised) {
      result.push_back(*failure.minimised);
      continue;
    }
    const auto known = finals.find(failure.first_signature);
    const std::string& signature =
        known == finals.end()
            ? failure.first_signature
            : std::max_element(known->second.begin(), known->second.end(), [](const auto& a, const auto& b) {
                return a.second < b.second;
              })->first;
    result.push_back({.run = failure.run, .signature = signature});
  }
  return result;
}

}  // namespace tiltproof::harness
