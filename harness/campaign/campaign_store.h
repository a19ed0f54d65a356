// campaign.sqlite: what a campaign has flown. The only part of the program that sees SQLite.
//
//   CampaignStore store("results/night/campaign.sqlite", CampaignStore::Mode::kCreate);
//   store.SetMeta("seed", "7");
//   store.Add(runs);  // one transaction
//   store.ForEach([](const CampaignRun& run) { Report(run.number, run.verdict); });
//
// Users read the tables `run`, `fault`, `criterion` and `failure` with SQL (docs/campaigns.md). They are views of smaller
// tables, in which a text stands once.
//
// A transaction is in the file as a whole or not at all, even when the program is killed. After a power failure the last
// ones may be missing. One program writes at a time; others read meanwhile.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace tiltproof::harness {

struct CampaignFault {
  std::string id, type, place;
  double severity = 0.0;  // its level, in the unit of the type's severity at the place
  double start_s = 0.0, end_s = 0.0;
  std::int64_t activations = 0;
  bool operator==(const CampaignFault&) const = default;
};

struct CriterionRow {
  std::string name, verdict;
  std::optional<double> margin;
  bool operator==(const CriterionRow&) const = default;
};

// One flight of a campaign.
struct CampaignRun {
  std::uint64_t number = 0, seed = 0;
  std::string scenario, firmware;
  std::string verdict, end, criterion;  // the criterion that decided; empty when it passed
  std::optional<double> time_s, margin;
  std::string trace_hash;
  double wall_s = 0.0;
  std::string signature;  // the first one (campaign_signature.h); empty: green
  std::vector<CampaignFault> faults;
  std::vector<CriterionRow> criteria;
  bool operator==(const CampaignRun&) const = default;
};

// A run that failed, and the smallest scenario that fails like it.
struct CampaignFailure {
  std::uint64_t run = 0;
  std::string signature;                 // the final one
  std::optional<std::string> minimal{};  // its file, from the campaign's folder; none: not minimised
  bool operator==(const CampaignFailure&) const = default;
};

// A run that another client flew again.
struct CampaignConfirmation {
  std::uint64_t run = 0;
  std::string client;  // as --client names it
  std::string verdict, end, criterion;
  std::optional<double> time_s, margin;
  std::string trace_hash;
  bool operator==(const CampaignConfirmation&) const = default;
};

// All errors name the file. FileError: the disk is full, or refuses; what was added before is kept. std::runtime_error:
// a second writer, a file that is no campaign, or one of a newer tiltproof.
class CampaignStore {
 public:
  enum class Mode : std::uint8_t {
    kCreate,  // an error where there is a campaign already
    kOpen,    // goes on with one
    kRead,    // also while another program writes
  };
  CampaignStore(std::filesystem::path file, Mode mode);
  ~CampaignStore();
  CampaignStore(const CampaignStore&) = delete;
  CampaignStore& operator=(const CampaignStore&) = delete;
  const std::filesystem::path& file() const;

  // One transaction. After an exception none of them is there, and the store can be used further. A number that is there
  // already is an error.
  void Add(std::span<const CampaignRun> runs);
  bool Has(std::uint64_t number) const;
  std::vector<std::uint64_t> FlownNumbers() const;  // ascending
  std::optional<CampaignRun> Find(std::uint64_t number) const;
  // In the order of the numbers; the memory does not grow with them.
  void ForEach(const std::function<void(const CampaignRun&)>& visit) const;
  // The same of two campaigns at once: for each number that is in one of them, the run of each; null: it has none.
  void ForEachBeside(const CampaignStore& other,
                     const std::function<void(const CampaignRun*, const CampaignRun*)>& visit) const;
  std::uint64_t Count() const;

  // Texts about the campaign, under any key.
  void SetMeta(const std::string& key, const std::string& value);
  std::optional<std::string> Meta(const std::string& key) const;
  std::map<std::string, std::string> AllMeta() const;

  // Replaces those of the same runs; one transaction.
  void PutFailures(std::span<const CampaignFailure> failures);
  std::vector<CampaignFailure> Failures() const;  // in the order of the runs

  // Replaces those of the same run and client; one transaction.
  void PutConfirmations(std::span<const CampaignConfirmation> confirmations);
  std::vector<CampaignConfirmation> Confirmations() const;  // by client and run

 private:
  struct Impl;
  class Reader;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tiltproof::harness
