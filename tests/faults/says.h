// The one problem that a test expects of a fault's specification.
//
//   EXPECT_THAT(Validate(spec), Says("duty", "needs period_s"));
#pragma once

#include <gmock/gmock.h>

#include <string>

#include "faults/registry.h"

namespace tiltproof::faults {

// A list of one problem with this key, whose message contains `message`.
inline auto Says(const std::string& key, const std::string& message) {
  return ::testing::ElementsAre(
      ::testing::AllOf(::testing::Field(&Problem::key, key),
                       ::testing::Field(&Problem::message, ::testing::HasSubstr(message))));
}

}  // namespace tiltproof::faults
