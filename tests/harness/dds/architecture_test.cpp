// ARCHITECTURE.md prints the table of topics that the code has.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "harness/dds/qos.h"

namespace tiltproof::dds {
namespace {

TEST(Architecture, HasTheTableOfTopics) {
  std::string table = "| topic | type | QoS | why |\n|---|---|---|---|\n";
  for (const TopicRow& row : TopicTable())
    table += "| " + row.topic + " | " + row.type + " | " + row.qos + " | " + row.why + " |\n";
  std::ifstream file(TILTPROOF_SOURCE_DIR "/ARCHITECTURE.md");
  std::ostringstream text;
  text << file.rdbuf();
  EXPECT_THAT(text.str(), ::testing::HasSubstr(table)) << "the table is:\n" << table;
}

}  // namespace
}  // namespace tiltproof::dds
