// The readers of a run's folder: any content of its files is read or refused as a std::runtime_error; what was read is
// written and read again as the same text.
//
// Input: the first byte chooses the file; the rest is its content. The other files of the folder are sound.
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/results.h"
#include "harness/report/trace_csv.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/scratch.h"

namespace {

using namespace tiltproof::harness;
using tiltproof::testing::Require;
using tiltproof::testing::Tried;

// A run of one flight of two rows.
std::filesystem::path WriteSoundFolder() {
  auto folder = tiltproof::testing::ScratchFolder() / "run";
  RunLog log;
  log.clients.resize(1);
  log.trace = Trace({"t_s", "x_m"});
  for (const double t_s : {0.0, 0.012}) log.trace.AppendRow()[0] = t_s;
  std::filesystem::create_directories(folder);
  WriteFlight(folder, Scenario{}, log);
  RunInfo info;
  info.flights = {{.name = "hover"}};
  WriteRunInfo(folder, info);
  WriteResults(folder, info, {NotFlown(info.flights.front())});
  return folder;
}

void Write(const std::string& file, const std::string& text) {
  tiltproof::testing::ScratchFile(std::filesystem::path("run") / file,
                                  {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

void ReadVerdict(const std::string& text) {
  const auto result = Tried<std::runtime_error>([&] { return ResultFromJsonText(text); });
  if (!result) return;
  const std::string written = ToJsonText(*result);
  Require(ToJsonText(ResultFromJsonText(written)) == written, "a verdict: written and read");
}

void ReadTrace(const std::string& text) {
  const auto trace = Tried<std::runtime_error>([&] { return ReadTraceCsv(text); });
  if (!trace) return;
  const std::string written = WriteTraceCsv(*trace);
  Require(WriteTraceCsv(ReadTraceCsv(written)) == written, "a trace: written and read");
}

void ReadFolderWith(const std::string& file, const std::string& text) {
  // Once: writing it takes longer than reading it.
  static const auto folder = WriteSoundFolder();
  const std::string sound = ReadFile(folder / file);
  Write(file, text);
  Tried<std::runtime_error>([&] { return ReadFlight(folder).trace.row_count(); });
  Tried<std::runtime_error>([&] { return ReadResults(folder).size(); });
  const auto info = Tried<std::runtime_error>([&] { return ReadRunInfo(folder); });
  if (info && file == "run.json") {
    WriteRunInfo(folder, *info);
    const std::string written = ReadFile(folder / file);
    WriteRunInfo(folder, ReadRunInfo(folder));
    Require(ReadFile(folder / file) == written, "a run: written and read");
  }
  Write(file, sound);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(data + 1, data + size);
  switch (data[0] % 5) {
    case 0:
      ReadVerdict(text);
      break;
    case 1:
      ReadTrace(text);
      break;
    case 2:
      ReadFolderWith("flight.json", text);
      break;
    case 3:
      ReadFolderWith("run.json", text);
      break;
    default:
      ReadFolderWith("results.json", text);
  }
  return 0;
}
