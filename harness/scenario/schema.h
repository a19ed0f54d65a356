// The scenario file for editors and for people, generated from the keys that the reader knows.
#pragma once

#include <string>

namespace tiltproof::harness {

// JSON Schema, draft 2020-12. It knows keys, types, ranges and words; what needs other files (models,
// formulas, recordings) or compares keys with each other is the reader's alone.
std::string ScenarioJsonSchema();

// The same as Markdown tables: one for each mapping.
std::string ScenarioKeysMarkdown();

}  // namespace tiltproof::harness
