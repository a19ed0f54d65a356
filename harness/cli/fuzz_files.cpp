#include "harness/cli/fuzz_files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "harness/cli/client_flag.h"
#include "harness/cli/commands.h"
#include "harness/cli/scenario_comment.h"
#include "harness/cli/suite.h"
#include "harness/report/files.h"
#include "harness/report/json_text.h"
#include "harness/run/hash.h"
#include "harness/scenario/reader.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;

// In the order of their names, without hidden ones and what is half written.
std::vector<fs::path> FilesIn(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename();
    if (entry.is_regular_file() && !name.starts_with('.') && !name.ends_with(".part"))
      files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

// Comments above a finding: the reason, the frames, and the command that flies it again.
std::string Heading(const FuzzFinding& finding, const link::Protocol& protocol, const std::string& replay) {
  std::string text = Comment(fmt::format("Found by tiltproof fuzz: {}", finding.broken.reason));
  text += fmt::format("#\n# What is said {}:\n", PlaceText(finding.sequence));
  const std::vector<std::string> frames = Describe(finding.sequence, protocol);
  for (std::size_t i = 0; i < frames.size(); ++i) text += Comment(fmt::format("{:4}: {}", i + 1, frames[i]));
  text += "#\n";
  if (!finding.minimised) text += "# The campaign ended before it was as small as it could be made.\n";
  if (finding.minimised && !finding.confirmed)
    text += "# Flown once more it did not break: it depends on more than these bytes.\n";
  if (!finding.broken.may_pass.empty()) {
    text += Comment(finding.broken.may_pass) + "# To fly it again:\n";
  } else if (finding.confirmed) {
    text += "# It fails as long as the defect is there, and passes afterwards:\n";
  } else {
    text += "# To fly it again:\n";
  }
  return text + Comment(replay);
}

}  // namespace

Scenario FuzzBase(const std::string& firmware, std::shared_ptr<const link::Protocol> protocol,
                  const std::string& model) {
  Scenario base;
  base.name = "fuzz";
  base.firmware = firmware;
  base.model = model;
  base.held = true;
  base.duration_ns = kNsPerS;
  base.link.protocol = std::move(protocol);
  base.initial_position_m = {0, 0, 1};
  base.reference.path = HoverReference{.at_m = base.initial_position_m};
  return base;
}

FuzzFiles::FuzzFiles(fs::path folder, std::string flags)
    : folder_(std::move(folder)), flags_(std::move(flags)) {
  if (folder_.empty()) throw UsageError("--out: the name of the folder is empty");
  for (const char* part : {"findings", "corpus"}) {
    std::error_code error;
    fs::create_directories(folder_ / part, error);
    if (error || !fs::is_directory(folder_ / part, error))
      throw UsageError(fmt::format("--out {}: cannot make the folder {}: {}", folder_.string(),
                                   (folder_ / part).string(),
                                   error ? error.message() : "something else has its name"));
  }
  // Where the file system knows no locks, nothing is kept out.
  lock_ = link::OwnedDescriptor(open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (flock(lock_.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
    throw UsageError(
        fmt::format("--out {}: another `tiltproof fuzz` writes there; wait for it, or name another folder",
                    folder_.string()));
  try {
    WriteFile(folder_ / "findings" / ".writable", "");
    fs::remove(folder_ / "findings" / ".writable");
  } catch (const std::exception& error) {
    throw UsageError(fmt::format("--out {}: {}", folder_.string(), error.what()));
  }
}

fs::path FuzzFiles::FileOf(const std::string& finding) const {
  return folder_ / "findings" / (finding + ".yaml");
}

std::string FuzzFiles::ReplayOf(const FuzzFinding& finding) const {
  return fmt::format("tiltproof run {}{}", Quoted(FileOf(finding.broken.Name()).string()), flags_);
}

void FuzzFiles::Write(const FuzzFinding& finding, const Scenario& base) const {
  Scenario flight = FlightOf(base, finding.sequence);
  flight.name = finding.broken.Name();
  flight.tags = {"fuzz", finding.broken.kind};
  WriteFile(FileOf(flight.name),
            Heading(finding, *base.link.protocol, ReplayOf(finding)) + WriteResolved(flight));
}

std::vector<std::pair<std::string, HostileSequence>> FuzzFiles::ReadFindings() const {
  constexpr std::string_view kScriptType = "frame.script";
  std::vector<std::pair<std::string, HostileSequence>> findings;
  for (const fs::path& file : FilesIn(folder_ / "findings")) {
    if (file.extension() != ".yaml") continue;
    try {
      const Scenario scenario = LoadAnnounced(ReadFile(file)).scenario;
      const bool is_one = scenario.faults.size() == 1 && scenario.faults.front().type == kScriptType;
      if (!is_one) throw std::runtime_error(fmt::format("it has to have one fault, of type {}", kScriptType));
      const faults::FaultSpec& fault = scenario.faults.front();
      const auto text = [&](const char* key) { return std::get<std::string>(fault.parameters.at(key)); };
      findings.emplace_back(file.stem(), ReadSequence(fmt::format("{} {}\n{}\n", faults::Name(fault.target),
                                                                  text("place"), text("frames"))));
    } catch (const std::exception& error) {
      // Left out, it would be a finding that nothing breaks any more.
      throw UsageError(fmt::format("{}: no finding of `tiltproof fuzz`: {}; fix or remove it", file.string(),
                                   error.what()));
    }
  }
  return findings;
}

void FuzzFiles::Add(const HostileSequence& sequence) const {
  const std::string text = ToText(sequence);
  const std::uint64_t hash = Fnv1a({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  WriteFile(folder_ / "corpus" / fmt::format("{:016x}", hash), text);
}

std::vector<HostileSequence> FuzzFiles::ReadCorpus() const {
  std::vector<HostileSequence> corpus;
  for (const fs::path& file : FilesIn(folder_ / "corpus")) {
    try {
      corpus.push_back(ReadSequence(ReadFile(file)));
    } catch (const std::exception& error) {
      throw UsageError(
          fmt::format("{}: no sequence of a corpus: {}; remove it", file.string(), error.what()));
    }
  }
  return corpus;
}

nlohmann::ordered_json FuzzFiles::ReadSummary() const {
  try {
    return nlohmann::ordered_json::parse(ReadFile(folder_ / "fuzz.json"));
  } catch (const std::exception&) {
    return nullptr;
  }
}

void FuzzFiles::WriteSummary(const nlohmann::ordered_json& summary) const {
  WriteFile(folder_ / "fuzz.json", JsonText(summary, 2) + '\n');
}

}  // namespace tiltproof::harness
