// A folder of each test's own, and what a call says when it fails.
#pragma once

#include <gtest/gtest.h>

#include <exception>
#include <filesystem>
#include <string>

namespace tiltproof::harness {

class FolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        std::filesystem::temp_directory_path() /
        (std::string("tiltproof-report-") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_;
};

template <class Function>
std::string ErrorOf(Function&& function) {
  try {
    function();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace tiltproof::harness
