#include "faults/nearest_name.h"

#include <algorithm>
#include <vector>

namespace tiltproof::faults {

std::size_t EditDistance(std::string_view a, std::string_view b) {
  // Rows i - 2, i - 1 and i of the table of distances between prefixes.
  std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    before.swap(last);
    last.swap(row);
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) row[j] = std::min(row[j], before[j - 2] + 1);
    }
  }
  return row[b.size()];
}

namespace {

std::vector<std::string_view> PartsOf(std::string_view name) {
  std::vector<std::string_view> parts;
  while (!name.empty()) {
    const std::size_t end = std::min(name.find_first_of("_.-"), name.size());
    if (end > 0) parts.push_back(name.substr(0, end));
    name.remove_prefix(std::min(end + 1, name.size()));
  }
  return parts;
}

// Each part begins one of the candidate's, in their order, the first one the first.
bool Abbreviates(std::string_view name, std::string_view candidate) {
  const std::vector<std::string_view> parts = PartsOf(name), whole = PartsOf(candidate);
  std::size_t at = 0;
  for (const std::string_view part : parts) {
    while (at < whole.size() && !whole[at].starts_with(part)) {
      if (at == 0) return false;
      ++at;
    }
    if (at++ == whole.size()) return false;
  }
  return name.size() > 1 && !parts.empty();
}

}  // namespace

std::string_view NearestName(std::string_view name, std::span<const std::string_view> candidates) {
  std::string_view nearest;
  std::size_t nearest_distance = 0;
  for (const std::string_view candidate : candidates) {
    const std::size_t distance = EditDistance(name, candidate);
    const std::size_t limit = std::max<std::size_t>(2, std::max(name.size(), candidate.size()) / 3);
    if (distance > limit || (!nearest.empty() && distance >= nearest_distance)) continue;
    nearest = candidate;
    nearest_distance = distance;
  }
  if (!nearest.empty()) return nearest;
  for (const std::string_view candidate : candidates)
    if (Abbreviates(name, candidate) && (nearest.empty() || candidate.size() < nearest.size()))
      nearest = candidate;
  return nearest;
}

}  // namespace tiltproof::faults
