#include "harness/report/trace_file.h"

#include <fmt/format.h>

#include <stdexcept>
#include <string>

#include "harness/report/files.h"
#include "harness/report/flight_hashes.h"
#include "harness/report/trace_csv.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

constexpr const char* kCsvFile = "trace.csv";
constexpr const char* kPackedFile = "trace.packed";

bool IsPacked(const std::filesystem::path& trace_file) { return trace_file.filename() == kPackedFile; }

}  // namespace

std::string_view Name(TraceFormat format) {
  switch (format) {
    case TraceFormat::kCsv:
      return "csv";
    case TraceFormat::kPacked:
      return "packed";
    case TraceFormat::kNone:
      return "none";
  }
  ThrowBrokenInvariant("a format of the trace");
}

void WriteTrace(const std::filesystem::path& folder, const Trace& trace, TraceFormat format) {
  if (format == TraceFormat::kCsv) WriteFile(folder / kCsvFile, WriteTraceCsv(trace));
  if (format == TraceFormat::kPacked) WriteFile(folder / kPackedFile, PackTrace(trace));
}

std::filesystem::path FindTrace(const std::filesystem::path& folder) {
  const auto csv = folder / kCsvFile, packed = folder / kPackedFile;
  const bool has_csv = std::filesystem::exists(csv), has_packed = std::filesystem::exists(packed);
  if (has_csv && has_packed)
    throw FileError(
        fmt::format("{} has both {} and {}, and they may differ: remove the one that is not the flight's",
                    folder.string(), kCsvFile, kPackedFile));
  return has_csv ? csv : has_packed ? packed : std::filesystem::path();
}

TracePart ReadTracePart(const std::filesystem::path& folder) {
  const auto file = FindTrace(folder);
  if (file.empty())
    throw FileError(fmt::format("no {} or {} in {}: it was removed, or flown with --trace none", kCsvFile,
                                kPackedFile, folder.string()));
  const std::string content = ReadFile(file);
  TracePart part = IsPacked(file) ? UnpackTrace(content) : ReadTraceCsvPart(content);
  // The damage of a file that was cut says more than its hash.
  if (part.trouble.empty()) CheckFlightFile(file, content);
  if (!part.trouble.empty()) part.trouble.insert(0, file.string() + ": ");
  return part;
}

Trace ReadTrace(const std::filesystem::path& folder) {
  TracePart part = ReadTracePart(folder);
  if (!part.trouble.empty()) throw std::runtime_error(part.trouble);
  return std::move(part.trace);
}

std::uintmax_t TraceTextBytes(const std::filesystem::path& trace_file) {
  if (!IsPacked(trace_file)) return std::filesystem::file_size(trace_file);
  constexpr std::uintmax_t kBytesPerValue = 16;
  return PackedValuesCount(ReadFile(trace_file)) * kBytesPerValue;
}

}  // namespace tiltproof::harness
