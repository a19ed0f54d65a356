// The fold of an associative operation over windows that only move forward: one pass for minimum, maximum,
// "until" and the like.
//
//   SlidingFold<double, Min> fold(values, infinity);
//   for (std::size_t i = 0; i < lowest.size(); ++i)
//     lowest[i] = fold.Over(first(i), last(i));  // of values[first, last); neither bound ever decreases
//
// Two stacks: values that entered since the last turn are folded into one value; values that entered before
// are stored as partial folds, one per place where the window may begin. Whatever the width of the windows,
// each value is folded at most twice, plus once for each answer. The operation need neither commute nor have
// an inverse.
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "link/check.h"

namespace tiltproof::harness {

template <class Value, class Operation>
class SlidingFold {
 public:
  // `neutral` is the fold of an empty window. The values must outlive this object.
  SlidingFold(std::span<const Value> values, Value neutral, Operation operation = {})
      : values_(values),
        neutral_(neutral),
        front_(values.size()),
        back_(neutral),
        operation_(std::move(operation)) {}

  // Fold of values[first, last); neutral when first >= last. Neither bound may be less than in the call
  // before.
  Value Over(std::size_t first, std::size_t last) {
    Check(last <= values_.size(), "a window ends within its values");
    for (; last_ < last; ++last_) back_ = operation_(back_, values_[last_]);
    if (first >= turn_) Refold(first);
    if (first >= last_) return neutral_;
    return operation_(front_[first], back_);
  }

 private:
  // Turns all that is in the window into partial folds from the end.
  void Refold(std::size_t first) {
    Value fold = neutral_;
    for (std::size_t i = last_; i > first; --i) {
      fold = operation_(values_[i - 1], fold);
      front_[i - 1] = fold;
    }
    turn_ = last_;
    back_ = neutral_;
  }

  std::span<const Value> values_;
  Value neutral_;
  std::vector<Value> front_;  // [i], i < turn_: the fold of values[i, turn_)
  Value back_;                // the fold of values[turn_, last_)
  std::size_t turn_ = 0;
  std::size_t last_ = 0;
  Operation operation_;
};

}  // namespace tiltproof::harness
