// Hosts that hold other files than the harness are found out.
#include "harness/run/flown_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

namespace tiltproof::harness {
namespace {

using ::testing::HasSubstr;

class FlownFilesTest : public ::testing::Test {
 protected:
  FlownFilesTest() {
    std::filesystem::create_directories(folder_);
    Write("vehicle.sdf", "<sdf/>");
    scenario_.model_file = folder_ / "vehicle.sdf";
    for (const FlownFile& file : FlownFiles(scenario_)) {
      files_.push_back(file.what);
      hashes_.push_back(file.hash);
    }
  }
  ~FlownFilesTest() override { std::filesystem::remove_all(folder_); }
  void Write(const char* name, const char* text) const { std::ofstream(folder_ / name) << text; }
  std::string Differs() const { return DifferingFile(scenario_, files_, hashes_); }

  std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) / ("tiltproof-flown-files-" + std::to_string(getpid()));
  Scenario scenario_;
  std::vector<std::string> files_, hashes_;  // as the harness announces them
};

TEST_F(FlownFilesTest, TheSameAreTheSame) {
  EXPECT_THAT(files_, ::testing::ElementsAre("vehicle"));
  EXPECT_EQ(Differs(), "");
}

TEST_F(FlownFilesTest, AnotherContentIsNamedWithItsFile) {
  Write("vehicle.sdf", "<sdf />");
  EXPECT_THAT(Differs(),
              HasSubstr("the vehicle " + scenario_.model_file.string() + " on this host is another one"));
}

TEST_F(FlownFilesTest, AFileThatOnlyOneHasIsNamed) {
  Write("vehicle.tiltproof.xml", "<x/>");
  EXPECT_THAT(Differs(), HasSubstr("the harness has no file for the tiltproof elements"));
  files_.emplace_back("recorded reference");
  hashes_.emplace_back("0123456789abcdef");
  std::filesystem::remove(folder_ / "vehicle.tiltproof.xml");
  EXPECT_EQ(Differs(), "this host has no file for the recorded reference");
}

TEST_F(FlownFilesTest, ARecordedReferenceIsOneOfThem) {
  Write("path.csv", "t_s,x_m");
  scenario_.reference.path = RecordedReference{folder_ / "path.csv"};
  EXPECT_EQ(FlownFiles(scenario_).back().what, "recorded reference");
  EXPECT_THAT(Differs(), HasSubstr("the harness has no file for the recorded reference"));
}

TEST_F(FlownFilesTest, AFileThatTheVehicleIncludesIsOneOfThem) {
  Write(
      "vehicle.sdf",
      "<sdf version='1.9'><model name='v'><include merge='true'><uri>part.sdf</uri></include></model></sdf>");
  Write("part.sdf", "<sdf version='1.9'><model name='p'/></sdf>");
  const std::vector<FlownFile> files = FlownFiles(scenario_);
  ASSERT_EQ(files.size(), 2U);
  EXPECT_EQ(files[1].what, "file 1 that the vehicle includes");
  EXPECT_EQ(files[1].path, folder_ / "part.sdf");
  Write("part.sdf", "<sdf version='1.9'><model name='q'/></sdf>");
  EXPECT_NE(FlownFiles(scenario_)[1].hash, files[1].hash);
}

}  // namespace
}  // namespace tiltproof::harness
