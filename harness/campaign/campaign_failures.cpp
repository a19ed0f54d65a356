#include "harness/campaign/campaign_failures.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "harness/campaign/campaign_signature.h"
#include "harness/campaign/campaign_summary.h"
#include "harness/report/files.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kRunsPerTransaction = 1000;

std::string FileOfRun(const std::string& signature, std::uint64_t run) {
  return fmt::format("failures/{}/run-{}.yaml", signature, run);
}

void WriteText(const fs::path& file, const std::string& text) {
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  if (error) throw FileError(fmt::format("{}: {}", file.parent_path().string(), error.message()));
  WriteFile(file, text);
}

// All failures, and the runs to minimise.
struct Failing {
  std::vector<FirstFailure> failures;
  std::map<std::uint64_t, std::size_t> chosen;                           // the place of each in the list
  std::map<std::uint64_t, std::pair<std::string, std::string>> decided;  // their criterion and end
};
Failing FailingOf(const CampaignStore& store) {
  Failing failing;
  MinimisedChooser chooser;
  store.ForEach([&](const CampaignRun& run) {
    if (run.signature.empty()) return;
    if (chooser.Choose(run.signature)) {
      failing.chosen.emplace(run.number, failing.failures.size());
      failing.decided.emplace(run.number, std::pair(run.criterion, run.end));
    }
    failing.failures.push_back({run.number, run.signature, {}});
  });
  return failing;
}

// Final signatures into the store, and the scenario of each into the folder.
void Finish(CampaignStore& store, const fs::path& folder, const Failing& failing) {
  const std::vector<CampaignFailure> finals = FinalFailures(failing.failures);
  store.PutFailures(finals);
  std::set<std::string> written;
  for (const CampaignFailure& failure : finals)
    if (failure.minimal && written.insert(failure.signature).second)
      WriteText(folder / "failures" / failure.signature / "scenario.yaml",
                ReadFile(folder / *failure.minimal));
}

}  // namespace

void MinimiseFailures(CampaignStore& store, const fs::path& folder, const Minimiser& minimise) {
  Failing failing = FailingOf(store);
  for (const CampaignFailure& known : store.Failures()) {
    const auto chosen = failing.chosen.find(known.run);
    if (known.minimal && chosen != failing.chosen.end() && fs::exists(folder / *known.minimal))
      failing.failures[chosen->second].minimised = known;
  }
  for (const auto& [run, place] : failing.chosen) {
    FirstFailure& failure = failing.failures[place];
    if (failure.minimised) continue;
    const std::optional<MinimalForm> minimal = minimise(run);
    if (!minimal) continue;
    const auto& [criterion, end] = failing.decided.at(run);
    CampaignFailure found{.run = run, .signature = SignatureText(criterion, end, minimal->types)};
    found.minimal = FileOfRun(found.signature, run);
    WriteText(folder / *found.minimal, minimal->scenario);
    store.PutFailures({&found, 1});
    failure.minimised = found;
  }
  Finish(store, folder, failing);
}

std::vector<CampaignFailure> KeptFailures(std::span<const CampaignFailure> failures) {
  std::map<std::string, std::size_t> counts;
  for (const CampaignFailure& failure : failures) ++counts[failure.signature];
  std::vector<std::size_t> sizes;
  for (const auto& [signature, count] : counts) sizes.push_back(count);
  std::sort(sizes.rbegin(), sizes.rend());
  const std::size_t least = sizes.size() > kKeptMax ? sizes[kKeptMax - 1] : 0;
  std::set<std::string> known;
  std::vector<CampaignFailure> kept;
  for (const CampaignFailure& failure : failures)
    if (counts.at(failure.signature) >= least && kept.size() < kKeptMax &&
        known.insert(failure.signature).second)
      kept.push_back(failure);
  return kept;
}

namespace {

void CheckSameRun(const CampaignRun& known, CampaignRun run, const std::string& part) {
  run.wall_s = known.wall_s;
  if (run == known) return;
  const std::string which = run.trace_hash == known.trace_hash
                                ? ": the rows differ"
                                : fmt::format(": trace {} and trace {}", known.trace_hash, run.trace_hash);
  throw std::runtime_error(
      fmt::format("run {} of {} contradicts that of an earlier part{}", run.number, part, which));
}

// Keys of two campaigns that differ, apart from those of a part.
std::string DifferingKeys(const CampaignStore& a, const CampaignStore& b,
                          const std::set<std::string>& of_part) {
  const std::map<std::string, std::string> meta_a = a.AllMeta(), meta_b = b.AllMeta();
  std::map<std::string, std::string> keys = meta_a;
  keys.insert(meta_b.begin(), meta_b.end());
  std::string differing;
  for (const auto& [key, value] : keys) {
    const auto in_a = meta_a.find(key), in_b = meta_b.find(key);
    if (of_part.contains(key) ||
        (in_a != meta_a.end() && in_b != meta_b.end() && in_a->second == in_b->second))
      continue;
    differing += (differing.empty() ? "" : ", ") + key;
  }
  return differing;
}

}  // namespace

void AddRunsOf(const CampaignStore& from, const std::string& part, const std::set<std::string>& of_part,
               CampaignStore& into) {
  if (const std::string keys = DifferingKeys(into, from, of_part); !keys.empty())
    throw std::runtime_error(
        fmt::format("{} is not of the same campaign as the others: {} differ", part, keys));
  std::vector<CampaignRun> batch;
  const auto add = [&] {
    into.Add(batch);
    batch.clear();
  };
  // A part has each of its runs once.
  const std::vector<std::uint64_t> known = into.FlownNumbers();
  from.ForEach([&](const CampaignRun& run) {
    if (std::binary_search(known.begin(), known.end(), run.number))
      return CheckSameRun(*into.Find(run.number), run, part);
    batch.push_back(run);
    if (batch.size() == kRunsPerTransaction) add();
  });
  add();
}

void WriteSummary(const CampaignStore& store, const fs::path& folder) {
  WriteFile(folder / "campaign.json", ToJsonText(Summarize(store)));
}

namespace {

class Merger {
 public:
  Merger(const fs::path& folder, const std::map<std::string, std::string>& of_shard)
      : folder_(folder), of_shard_(of_shard), file_(folder / "campaign.sqlite.merging") {
    std::error_code error;
    fs::create_directories(folder, error);
    if (error) throw FileError(fmt::format("{}: {}", folder.string(), error.message()));
    if (fs::exists(folder / kStoreFile))
      throw std::runtime_error(fmt::format("{}: there is a campaign already", folder.string()));
    RemoveTrial();
    store_.emplace(file_, CampaignStore::Mode::kCreate);
  }
  ~Merger() {
    store_.reset();
    RemoveTrial();
  }
  Merger(const Merger&) = delete;
  Merger& operator=(const Merger&) = delete;

  void Add(const fs::path& shard) {
    const CampaignStore store(shard / kStoreFile, CampaignStore::Mode::kRead);
    std::set<std::string> of_part;
    for (const auto& [key, value] : of_shard_) of_part.insert(key);
    if (shards_.empty()) {
      for (const auto& [key, value] : store.AllMeta()) store_->SetMeta(key, value);
      for (const auto& [key, value] : of_shard_) store_->SetMeta(key, value);
    }
    AddRunsOf(store, shard.string(), of_part, *store_);
    store_->PutConfirmations(store.Confirmations());
    for (const CampaignFailure& failure : store.Failures())
      if (failure.minimal) minimised_.try_emplace(failure.run, failure, shard);
    shards_.push_back(shard);
  }

  void Finish() {
    Failing failing = FailingOf(*store_);
    for (const auto& [run, place] : failing.chosen) {
      const auto found = minimised_.find(run);
      if (found == minimised_.end()) continue;
      const auto& [failure, shard] = found->second;
      if (!fs::exists(shard / *failure.minimal)) continue;
      WriteText(folder_ / *failure.minimal, ReadFile(shard / *failure.minimal));
      failing.failures[place].minimised = failure;
    }
    harness::Finish(*store_, folder_, failing);
    CopyFlights();
    WriteSummary(*store_, folder_);
    store_.reset();
    std::error_code error;
    fs::rename(file_, folder_ / kStoreFile, error);
    if (error) throw FileError(fmt::format("{}: {}", (folder_ / kStoreFile).string(), error.message()));
  }

 private:
  void RemoveTrial() const {
    for (const char* end : {"", "-wal", "-shm"}) {
      std::error_code error;
      fs::remove(file_.string() + end, error);
    }
  }

  // The flights of the failures that a whole campaign keeps, as far as the shards have them.
  void CopyFlights() const {
    for (const CampaignFailure& failure : KeptFailures(store_->Failures())) {
      const std::string name = fmt::format("run-{}", failure.run);
      fs::path found;
      for (const fs::path& shard : shards_) {
        std::error_code error;
        for (const auto& kept : fs::directory_iterator(shard / "failures", error)) {
          if (fs::is_directory(kept.path() / name)) found = kept.path();
        }
      }
      if (!found.empty()) Copy(found, folder_ / "failures" / failure.signature);
    }
  }
  // All but the scenarios, which follow from the signatures of the whole campaign.
  static void Copy(const fs::path& from, const fs::path& to) {
    std::error_code error;
    fs::create_directories(to, error);
    for (const auto& entry : fs::directory_iterator(from)) {
      if (entry.path().extension() == ".yaml") continue;
      fs::copy(entry.path(), to / entry.path().filename(),
               fs::copy_options::recursive | fs::copy_options::overwrite_existing, error);
      if (error)
        throw FileError(fmt::format("{}: {}", (to / entry.path().filename()).string(), error.message()));
    }
  }

  fs::path folder_;
  std::map<std::string, std::string> of_shard_;
  fs::path file_;
  std::optional<CampaignStore> store_;
  std::vector<fs::path> shards_;
  std::map<std::uint64_t, std::pair<CampaignFailure, fs::path>> minimised_;
};

}  // namespace

void MergeCampaigns(std::span<const fs::path> shards, const fs::path& folder,
                    const std::map<std::string, std::string>& of_shard) {
  Merger merger(folder, of_shard);
  for (const fs::path& shard : shards) merger.Add(shard);
  merger.Finish();
}

}  // namespace tiltproof::harness
