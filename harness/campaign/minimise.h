// The smallest list that still does what a longer one does, by leaving parts out. It is a variant of delta debugging
// (Zeller and Hildebrandt, Simplifying and Isolating Failure-Inducing Input, IEEE Transactions on Software Engineering
// 28(2), 2002) that bisects: when a part cannot be left out and its first half can, its second half is not tried whole,
// because it must hold a cause. One cause among n costs about log2(n) tests, k causes cost about k * log2(n).
//
//   const auto fails = [](const std::vector<int>& some) { return some.size() >= 2; };
//   const std::vector<int> left = Minimise<int>({1, 2, 3, 4}, fails, {.tests_max = 100});  // {3, 4}
//
// Nothing more can be left out of the result alone, unless the tests ran out. The list itself and the empty list are never
// tested: the first is known to fail, the second not to. No list is tested twice.
#pragma once

#include <cstddef>
#include <functional>
#include <set>
#include <span>
#include <utility>
#include <vector>

namespace tiltproof::harness {

struct MinimiseLimits {
  std::size_t tests_max = 1000;
  // So many items at the end of the list are suspects: the first test leaves out all others. 0: all are equal.
  std::size_t suspects_count = 0;
};

// The search over places in a list of `count` items. `fails` gets the places that are left, in order.
class PlacesMinimiser {
 public:
  using Fails = std::function<bool(const std::vector<std::size_t>&)>;
  PlacesMinimiser(std::size_t count, Fails fails, MinimiseLimits limits)
      : fails_(std::move(fails)), limits_(limits), left_(count) {
    for (std::size_t i = 0; i < count; ++i) left_[i] = i;
  }

  std::vector<std::size_t> Run() {
    const std::size_t count = left_.size();
    const std::size_t suspects = limits_.suspects_count < count ? limits_.suspects_count : count;
    const std::vector<std::size_t> places = left_;
    const std::span<const std::size_t> all = places;
    const bool gone = LeaveOut(all.first(count - suspects), suspects == 0);
    LeaveOut(all.last(suspects), gone);
    // More of a list that fails need not fail. So what was kept because of another test is tried by itself.
    while (LeaveOutOne()) {
      const std::vector<std::size_t> rest = left_;
      LeaveOut(rest, true);
    }
    return left_;
  }

 private:
  // True if nothing of the part is left. `holds_cause`: a test has shown that all of it cannot go.
  bool LeaveOut(std::span<const std::size_t> part, bool holds_cause) {
    if (part.empty() || (!holds_cause && Try(part))) return true;
    if (part.size() == 1) return false;
    const std::size_t half = part.size() / 2;
    const bool first_gone = LeaveOut(part.first(half), false);
    const bool second_gone = LeaveOut(part.subspan(half), holds_cause && first_gone);
    return first_gone && second_gone;
  }

  bool LeaveOutOne() {
    const std::vector<std::size_t> places = left_;
    for (const std::size_t place : places)
      if (Try({&place, 1})) return true;
    return false;
  }

  // Leaves the part out if the rest fails.
  bool Try(std::span<const std::size_t> part) {
    const std::set<std::size_t> out(part.begin(), part.end());
    std::vector<std::size_t> rest;
    for (const std::size_t place : left_)
      if (!out.contains(place)) rest.push_back(place);
    if (rest.empty() || limits_.tests_max == 0 || !tested_.insert(rest).second) return false;
    --limits_.tests_max;
    if (!fails_(rest)) return false;
    left_ = std::move(rest);
    return true;
  }

  Fails fails_;
  MinimiseLimits limits_;
  std::vector<std::size_t> left_;
  std::set<std::vector<std::size_t>> tested_;
};

template <class T>
std::vector<T> Minimise(const std::vector<T>& list, const std::function<bool(const std::vector<T>&)>& fails,
                        MinimiseLimits limits) {
  const auto at = [&](const std::vector<std::size_t>& places) {
    std::vector<T> some;
    for (const std::size_t place : places) some.push_back(list[place]);
    return some;
  };
  const auto places_fail = [&](const std::vector<std::size_t>& places) { return fails(at(places)); };
  return at(PlacesMinimiser(list.size(), places_fail, limits).Run());
}

}  // namespace tiltproof::harness
