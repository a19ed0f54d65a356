// Scenario files and protocol files for editors and for people, generated from the keys that the reader knows.
#pragma once

#include <string>
#include <vector>

#include "link/signal_table.h"

namespace tiltproof::harness {

// JSON Schema, draft 2020-12. It knows keys, types, ranges, words and which keys exclude each other. Only the
// reader checks what needs other files (models, recordings), a formula's text, and names that must differ.
// `metric_names` are those that a criterion may use. The names of `vehicle`, the usual one, are offered where a
// fault names a signal; every name is accepted.
std::string ScenarioJsonSchema(const std::vector<std::string>& metric_names, const VehicleSignals& vehicle);

// The schema of protocol files (harness/scenario/protocol_file.h). Only the reader checks what must fit together.
std::string ProtocolJsonSchema();

// The keys of scenario files as Markdown tables, one per mapping.
std::string ScenarioKeysMarkdown();

}  // namespace tiltproof::harness
