// A scenario's file whose faults are what a test is about, read in a folder of the test's own.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "harness/scenario/reader.h"

namespace tiltproof::harness {

class FaultFile : public testing::Test {
 protected:
  FaultFile() {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(testing::TempDir()) /
              (std::string("tiltproof_") + test->test_suite_name() + "_" + test->name());
    std::filesystem::create_directories(folder_ / "models");
    std::ofstream(folder_ / "models/tiltrotor.sdf") << "<sdf/>";
    options_.models_folder = folder_ / "models";
  }
  ~FaultFile() override { std::filesystem::remove_all(folder_); }

  // A scenario whose fifth and later lines are items of `faults`.
  Scenario Read(const std::string& faults) {
    return ParseScenario(
        "name: x\nduration_s: 24\nreference: {type: hover, at_m: [0, 0, 2]}\nfaults:\n" + faults,
        folder_ / "s.yaml", options_);
  }
  // The reader's message about a scenario with these faults, without the folder; "no error" if it accepts it.
  std::string Error(const std::string& faults) {
    try {
      Read(faults);
    } catch (const ScenarioError& error) {
      return error.what() + folder_.string().size() + 1;
    }
    return "no error";
  }

  std::filesystem::path folder_;
  ReadOptions options_;
};

}  // namespace tiltproof::harness
