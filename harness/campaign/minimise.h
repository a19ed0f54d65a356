// The smallest list that still does what a longer one does, by leaving parts out: delta debugging (Zeller and Hildebrandt,
// Simplifying and Isolating Failure-Inducing Input, IEEE Transactions on Software Engineering 28(2), 2002).
//
//   const auto fails = [](const std::vector<int>& some) { return some.size() >= 2; };
//   const std::vector<int> left = Minimise<int>({1, 2, 3, 4}, fails, 100);  // {3, 4}
//
// Nothing more can be left out of the result alone, unless the tests ran out. The list itself is never tested: it is known
// to fail.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

namespace tiltproof::harness {

template <class T>
std::vector<T> Minimise(std::vector<T> list, const std::function<bool(const std::vector<T>&)>& fails,
                        std::size_t tests_max) {
  using Difference = std::ptrdiff_t;
  const auto try_it = [&](std::vector<T> some) {
    if (tests_max == 0) return false;
    --tests_max;
    if (!fails(some)) return false;
    list = std::move(some);
    return true;
  };
  if (list.empty()) return list;
  // The input that breaks the firmware is mostly said last.
  for (std::size_t last = 1; last < list.size(); last *= 2)
    if (try_it({list.end() - static_cast<Difference>(last), list.end()})) break;
  for (std::size_t parts = 2; list.size() > 1 && tests_max > 0;) {
    const std::size_t size = (list.size() + parts - 1) / parts;
    bool smaller = false;
    // From the back, so that what is left of the list keeps its place while parts go.
    for (std::size_t part = (list.size() + size - 1) / size; part-- > 0 && tests_max > 0;) {
      if (part * size >= list.size()) continue;
      std::vector<T> without = list;
      const std::size_t begin = part * size, end = std::min(begin + size, list.size());
      without.erase(without.begin() + static_cast<Difference>(begin),
                    without.begin() + static_cast<Difference>(end));
      if (without.empty()) continue;
      smaller |= try_it(std::move(without));
    }
    if (size == 1 && !smaller) break;
    if (size > 1) parts = std::min(2 * parts, list.size());
  }
  return list;
}

}  // namespace tiltproof::harness
