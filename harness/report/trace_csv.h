// trace.csv: the trace with doubles in shortest round-trip form, so that an old run scores to the same
// numbers again.
#pragma once

#include <string>
#include <string_view>

#include "harness/report/packed_trace.h"
#include "harness/run/trace.h"

namespace tiltproof::harness {

// Header line, then one line per row; "nan" where a value does not exist yet.
std::string WriteTraceCsv(const Trace& trace);

// The rows before the first error, and the error with its line.
TracePart ReadTraceCsvPart(std::string_view csv);
// Throws std::runtime_error with the line of the error.
Trace ReadTraceCsv(std::string_view csv);

}  // namespace tiltproof::harness
