#include "harness/scenario/selection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;

Scenario Named(const std::string& name, std::vector<std::string> tags = {}) {
  Scenario scenario;
  scenario.name = name;
  scenario.tags = std::move(tags);
  return scenario;
}

bool Selects(std::string_view expression, const Scenario& scenario) {
  return Selection(expression).Matches(scenario);
}

TEST(Selection, WordsAreSubstringsOfNameAndTags) {
  const Scenario scenario = Named("wire-frame-Delay-fail", {"wire", "frame.delay"});
  EXPECT_TRUE(Selects("", scenario));
  EXPECT_TRUE(Selects("delay", scenario));
  EXPECT_TRUE(Selects("DELAY", scenario));
  EXPECT_TRUE(Selects("frame.delay", scenario));
  EXPECT_TRUE(Selects("re-fr", scenario));
  EXPECT_FALSE(Selects("delays", scenario));
}

TEST(Selection, AndOrNotAndParentheses) {
  const Scenario ab = Named("a-b"), a = Named("a"), c = Named("c");
  EXPECT_TRUE(Selects("a and b", ab));
  EXPECT_FALSE(Selects("a and b", a));
  EXPECT_TRUE(Selects("a and not b", a));
  EXPECT_FALSE(Selects("a and not b", ab));
  EXPECT_TRUE(Selects("not not a", a));
  // `and` binds tighter than `or`, `not` tighter than both.
  EXPECT_TRUE(Selects("c or a and b", c));
  EXPECT_FALSE(Selects("(c or a) and b", c));
  EXPECT_TRUE(Selects("not a or c", c));
  EXPECT_FALSE(Selects("not (a or c)", c));
  EXPECT_TRUE(Selects("(a)and(b)", ab));
  EXPECT_TRUE(Selects("a or b or c", c));
  EXPECT_TRUE(Selects("notable", Named("notable")));
}

TEST(Selection, MalformedExpressionsNameTheColumn) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"a and", "column 6: expected a word"},
      {"and a", "column 1: expected a word, found 'and'"},
      {"a b", "column 3: expected 'and', 'or' or the end, found 'b'"},
      {"(a", "column 3: expected ')'"},
      {"a)", "column 2: expected 'and', 'or' or the end, found ')'"},
      {"()", "column 2: expected a word, found ')'"},
      {"not", "column 4: expected a word"},
      {" ", "column 2: expected a word"},
      {std::string(1000, '('), "column 101: nested too deep"}};
  for (const auto& [expression, message] : cases) {
    try {
      Selection selection(expression);
      ADD_FAILURE() << expression;
    } catch (const std::invalid_argument& error) {
      EXPECT_EQ(std::string(error.what()), message) << expression;
    }
  }
}

TEST(Selection, TagIsExact) {
  const Selection selection("", "wire");
  EXPECT_TRUE(selection.Matches(Named("x", {"paper", "wire"})));
  EXPECT_FALSE(selection.Matches(Named("wire", {"wired"})));
  EXPECT_FALSE(Selection("y", "wire").Matches(Named("x", {"wire"})));
}

class FindTest : public testing::Test {
 protected:
  FindTest()
      : folder_(fs::path(testing::TempDir()) /
                (std::string("tiltproof_find_") +
                 testing::UnitTest::GetInstance()->current_test_info()->name())) {
    fs::remove_all(folder_);
    for (const char* name :
         {"suite/b.yaml", "suite/a.yml", "suite/deep/c.yaml", "suite/notes.txt", "other.yaml"}) {
      fs::create_directories((folder_ / name).parent_path());
      std::ofstream(folder_ / name) << "x";
    }
  }
  ~FindTest() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(FindTest, FoldersAreSearchedAndSorted) {
  EXPECT_THAT(FindScenarios({folder_ / "suite"}).Paths(),
              ElementsAre(folder_ / "suite/a.yml", folder_ / "suite/b.yaml", folder_ / "suite/deep/c.yaml"));
  EXPECT_THAT(FindScenarios({folder_ / "other.yaml", folder_ / "suite/deep"}).Paths(),
              ElementsAre(folder_ / "other.yaml", folder_ / "suite/deep/c.yaml"));
  EXPECT_THAT(FindScenarios({folder_ / "suite/notes.txt"}).Paths(), ElementsAre(folder_ / "suite/notes.txt"));
  EXPECT_THAT(FindScenarios({folder_ / "suite/b.yaml", folder_ / "suite" / "deep" / ".." / "b.yaml"}).Paths(),
              ElementsAre(folder_ / "suite/b.yaml"));
  EXPECT_TRUE(FindScenarios({}).files.empty());
}

TEST_F(FindTest, AFileIsNamedWhenAPathIsItsOwn) {
  const FoundScenarios found = FindScenarios({folder_ / "suite", folder_ / "suite/b.yaml"});
  ASSERT_EQ(found.files.size(), 3U);
  EXPECT_FALSE(found.files[0].named);
  EXPECT_TRUE(found.files[1].named);
}

TEST_F(FindTest, EveryPathThatIsMissingIsAProblem) {
  const FoundScenarios found = FindScenarios({folder_ / "none", folder_ / "suite", folder_ / "no.yaml"});
  EXPECT_THAT(found.problems, ElementsAre((folder_ / "none").string() + ": no such file or folder",
                                          (folder_ / "no.yaml").string() + ": no such file or folder"));
  EXPECT_EQ(found.files.size(), 3U);
}

TEST_F(FindTest, APathThatIsNearlyRightIsGuessed) {
  const auto problem = [&](const std::filesystem::path& path) {
    return FindScenarios({path}).problems.front().substr(path.string().size());
  };
  const std::string suite = (folder_ / "suite").string();
  EXPECT_EQ(problem(folder_ / "siute"), ": no such file or folder; did you mean '" + suite + "'?");
  EXPECT_EQ(problem(folder_ / "suites" / "b.yaml"),
            ": no such file or folder; did you mean '" + suite + "/b.yaml'?");
  EXPECT_EQ(problem(folder_ / "gremlin" / "b.yaml"), ": no such file or folder");
}

TEST_F(FindTest, LinksAreFollowedButNotInCircles) {
  fs::create_directory_symlink(folder_ / "suite", folder_ / "suite/deep/again");
  fs::create_directory_symlink(folder_ / "suite/deep", folder_ / "suite/alias");
  fs::create_directories(folder_ / "elsewhere");
  fs::rename(folder_ / "other.yaml", folder_ / "elsewhere/other.yaml");
  fs::create_directory_symlink("../elsewhere", folder_ / "suite/linked");
  fs::create_symlink("../elsewhere/other.yaml", folder_ / "suite/z.yaml");
  const FoundScenarios found = FindScenarios({folder_ / "suite"});
  EXPECT_THAT(found.Paths(), ElementsAre(folder_ / "suite/a.yml", folder_ / "suite/b.yaml",
                                         folder_ / "suite/deep/c.yaml", folder_ / "suite/linked/other.yaml"));
  EXPECT_TRUE(found.problems.empty());
  EXPECT_THAT(found.warnings, ElementsAre((folder_ / "suite/deep/again").string() +
                                          ": not followed: a link to a folder that it is in"));
}

TEST_F(FindTest, SuiteIsNamedAfterFolderOrFile) {
  EXPECT_EQ(SuiteName({folder_ / "suite"}), "suite");
  EXPECT_EQ(SuiteName({(folder_ / "suite").string() + "/"}), "suite");
  EXPECT_EQ(SuiteName({folder_ / "suite" / "deep" / ".."}), "suite");
  EXPECT_EQ(SuiteName({folder_ / "other.yaml"}), "other");
  EXPECT_EQ(SuiteName({folder_ / "suite", folder_ / "other.yaml"}), "suite+other");
}

}  // namespace
}  // namespace tiltproof::harness
