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
    if (chooser.Take(run.signature)) {
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

  void Take(const fs::path& shard) {
    const CampaignStore store(shard / kStoreFile, CampaignStore::Mode::kRead);
    TakeMeta(store, shard);
    std::vector<CampaignRun> batch;
    const auto add = [&] {
      store_->Add(batch);
      batch.clear();
    };
    // Runs of this shard cannot be twice in it: only earlier shards matter.
    const std::vector<std::uint64_t> known = store_->FlownNumbers();
    store.ForEach([&](const CampaignRun& run) {
      if (std::binary_search(known.begin(), known.end(), run.number)) {
        CheckSame(*store_->Find(run.number), run, shard);
        return;
      }
      batch.push_back(run);
      if (batch.size() == kRunsPerTransaction) add();
    });
    add();
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

  void TakeMeta(const CampaignStore& store, const fs::path& shard) {
    std::map<std::string, std::string> meta = store.AllMeta();
    std::erase_if(meta, [&](const auto& entry) { return of_shard_.contains(entry.first); });
    if (!meta_) {
      for (const auto* entries : {&meta, &of_shard_})
        for (const auto& [key, value] : *entries) store_->SetMeta(key, value);
      meta_ = meta;
      return;
    }
    if (meta == *meta_) return;
    std::string differing;
    meta.merge(std::map(*meta_));  // keys of both
    const std::map<std::string, std::string> own = store.AllMeta();
    for (const auto& [key, value] : meta)
      if (!own.contains(key) || !meta_->contains(key) || own.at(key) != meta_->at(key))
        differing += (differing.empty() ? "" : ", ") + key;
    throw std::runtime_error(fmt::format("{} and {} are not of the same campaign: {} differ",
                                         shards_.front().string(), shard.string(), differing));
  }

  void CheckSame(const CampaignRun& known, CampaignRun run, const fs::path& shard) const {
    run.wall_s = known.wall_s;
    if (run == known) return;
    const std::string which = run.trace_hash == known.trace_hash
                                  ? ": the rows differ"
                                  : fmt::format(": trace {} and trace {}", known.trace_hash, run.trace_hash);
    throw std::runtime_error(fmt::format("run {} of {} contradicts that of an earlier shard{}", run.number,
                                         shard.string(), which));
  }

  fs::path folder_;
  std::map<std::string, std::string> of_shard_;
  fs::path file_;
  std::optional<CampaignStore> store_;
  std::optional<std::map<std::string, std::string>> meta_;
  std::vector<fs::path> shards_;
  std::map<std::uint64_t, std::pair<CampaignFailure, fs::path>> minimised_;
};

}  // namespace

void MergeCampaigns(std::span<const fs::path> shards, const fs::path& folder,
                    const std::map<std::string, std::string>& of_shard) {
  Merger merger(folder, of_shard);
  for (const fs::path& shard : shards) merger.Take(shard);
  merger.Finish();
}

}  // namespace tiltproof::harness
