#include <gmock/gmock.h>

#include <fstream>
#include <string>

#include "tests/harness/scenario/fault_file.h"

namespace tiltproof::harness {
namespace {

using ::testing::EndsWith;

class RecordedReferenceFile : public FaultFile {
 protected:
  // The error of a flight of 10 s along these rows.
  std::string ErrorWith(const std::string& rows) {
    std::ofstream(folder_ / "path.csv") << "t_s,x_m,y_m,z_m,yaw_rad\n" << rows;
    try {
      ParseScenario("name: x\nduration_s: 10\nreference: {type: recorded, file: path.csv}\n",
                    folder_ / "s.yaml", options_);
    } catch (const ScenarioError& error) {
      return error.what();
    }
    return "no error";
  }
};

TEST_F(RecordedReferenceFile, OneThatIsNeverPlayedIsRefused) {
  EXPECT_THAT(
      ErrorWith("1700000000,0,0,2,0\n1700000004,4,0,2,0\n"),
      EndsWith(
          "s.yaml:3:35: file: " + (folder_ / "path.csv").string() +
          ": begins at t_s = 1700000000, when the flight of 10 s is over; subtract 1700000000 from t_s"));
  EXPECT_EQ(ErrorWith("9.9,0,0,2,0\n"), "no error");
}

TEST_F(RecordedReferenceFile, OneInTheGroundIsRefused) {
  EXPECT_THAT(ErrorWith("0,0,0,-2,0\n"),
              ::testing::HasSubstr("path.csv:2: z_m = -2 is in the ground: z points up"));
}

}  // namespace
}  // namespace tiltproof::harness
