// Finds the keys by which two resolved scenarios describe different flights.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tiltproof::harness {

// The keys by which the two files (scenario.resolved.yaml) describe different flights, in the order of the
// first file, with both values: "link.baud: 921600 and 115200". Names, texts, criteria and the firmware's build
// may differ: they describe or judge a flight, or are under test. Throws std::runtime_error when a text is no
// scenario.
std::vector<std::string> DifferingKeys(std::string_view yaml_a, std::string_view yaml_b);

}  // namespace tiltproof::harness
