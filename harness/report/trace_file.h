// The trace of a flight in its folder: trace.csv or trace.packed. Everything that opens an old trace does it here.
//
//   WriteTrace(folder, trace, TraceFormat::kPacked);
//   const Trace again = ReadTrace(folder);           // whichever is there
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>

#include "harness/report/packed_trace.h"
#include "harness/run/trace.h"

namespace tiltproof::harness {

enum class TraceFormat : std::uint8_t { kCsv, kPacked, kNone };
std::string_view Name(TraceFormat format);
constexpr TraceFormat LastOf(TraceFormat) { return TraceFormat::kNone; }

// kNone writes nothing. Throws FileError.
void WriteTrace(const std::filesystem::path& folder, const Trace& trace, TraceFormat format);

// The file with the trace; empty when there is none. Throws FileError when there are both, which may differ.
std::filesystem::path FindTrace(const std::filesystem::path& folder);

// Throws FileError when there is none, and std::runtime_error naming file and place when it is damaged.
Trace ReadTrace(const std::filesystem::path& folder);
// The rows before the first damage.
TracePart ReadTracePart(const std::filesystem::path& folder);

// About as many bytes as it has as trace.csv. Throws FileError.
std::uintmax_t TraceTextBytes(const std::filesystem::path& trace_file);

}  // namespace tiltproof::harness
