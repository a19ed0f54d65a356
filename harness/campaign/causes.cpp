#include "harness/campaign/causes.h"

#include <algorithm>
#include <deque>
#include <map>
#include <utility>

#include "harness/campaign/minimise.h"

namespace tiltproof::harness {
namespace {

FaultSet Without(FaultSet all, const FaultSet& removed) {
  for (const std::size_t fault : removed) all.erase(fault);
  return all;
}

bool HaveNoneInCommon(const FaultSet& a, const FaultSet& b) {
  return std::none_of(a.begin(), a.end(), [&](std::size_t fault) { return b.contains(fault); });
}

class Search {
 public:
  Search(const FaultSet& all,
         const std::function<std::vector<bool>(const std::vector<FaultSet>&)>& fails_with,
         std::size_t tests_max)
      : all_(all), fails_with_(fails_with), tests_max_(tests_max) {
    known_[all] = true;
  }

  Causes Run() {
    std::vector<FaultSet> without_one;
    for (const std::size_t fault : all_) without_one.push_back(Without(all_, {fault}));
    Test(without_one);
    for (const std::size_t fault : all_)
      if (!Fails(Without(all_, {fault}))) causes_.needed.push_back(fault);
    if (!causes_.complete) causes_.needed.clear();
    if (causes_.complete && causes_.needed.empty()) FindSets();
    std::sort(causes_.sets.begin(), causes_.sets.end(), [](const FaultSet& a, const FaultSet& b) {
      return std::pair(a.size(), a) < std::pair(b.size(), b);
    });
    return std::move(causes_);
  }

 private:
  // Tests those that are not known yet.
  void Test(const std::vector<FaultSet>& sets) {
    std::vector<FaultSet> asked;
    for (const FaultSet& set : sets)
      if (!known_.contains(set) && causes_.tests_count + asked.size() < tests_max_) asked.push_back(set);
    if (asked.empty()) return;
    const std::vector<bool> answers = fails_with_(asked);
    causes_.tests_count += answers.size();
    for (std::size_t i = 0; i < std::min(answers.size(), asked.size()); ++i) known_[asked[i]] = answers[i];
    if (answers.size() < asked.size()) tests_max_ = 0;
  }

  // False when it cannot be tested any more.
  bool Fails(const FaultSet& set) {
    Test({set});
    const auto found = known_.find(set);
    if (found == known_.end()) causes_.complete = false;
    return found != known_.end() && found->second;
  }

  // A smallest set of faults that fails, of those in a set that fails.
  FaultSet Shrink(const FaultSet& failing) {
    if (Fails({})) return {};
    const auto fails = [this](const std::vector<std::size_t>& some) {
      return Fails(FaultSet(some.begin(), some.end()));
    };
    const std::vector<std::size_t> left =
        Minimise<std::size_t>(std::vector<std::size_t>(failing.begin(), failing.end()), fails,
                              {.tests_max = tests_max_ + known_.size()});
    return {left.begin(), left.end()};
  }

  // Breadth first over what is removed, so that few faults are removed at first.
  void FindSets() {
    std::deque<FaultSet> removals = {{}};
    std::set<FaultSet> seen = {{}};
    while (!removals.empty() && causes_.complete) {
      const FaultSet removed = removals.front();
      removals.pop_front();
      auto set = std::find_if(causes_.sets.begin(), causes_.sets.end(),
                              [&](const FaultSet& known) { return HaveNoneInCommon(known, removed); });
      if (set == causes_.sets.end()) {
        const FaultSet rest = Without(all_, removed);
        if (!Fails(rest)) continue;
        const FaultSet smallest = Shrink(rest);
        if (!causes_.complete) return;
        set = causes_.sets.insert(causes_.sets.end(), smallest);
      }
      for (const std::size_t fault : FaultSet(*set)) {
        FaultSet more = removed;
        more.insert(fault);
        if (seen.insert(more).second) removals.push_back(std::move(more));
      }
    }
  }

  const FaultSet& all_;
  const std::function<std::vector<bool>(const std::vector<FaultSet>&)>& fails_with_;
  std::size_t tests_max_;
  std::map<FaultSet, bool> known_;
  Causes causes_;
};

}  // namespace

Causes FindCauses(const FaultSet& all,
                  const std::function<std::vector<bool>(const std::vector<FaultSet>&)>& fails_with,
                  std::size_t tests_max) {
  return Search(all, fails_with, tests_max).Run();
}

}  // namespace tiltproof::harness
