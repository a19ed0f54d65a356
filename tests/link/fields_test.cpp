#include "link/fields.h"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

namespace tiltproof {
namespace {

struct Whole {
  int number = 0;
  std::string text;
  std::optional<std::vector<int>> list;
  TILTPROOF_FIELDS(number, text, list)
};
struct WithOneForgotten {
  int number = 0;
  std::string text;
  TILTPROOF_FIELDS(number)
};
static_assert(NamesEveryField<Whole>());
static_assert(!NamesEveryField<WithOneForgotten>());

TEST(Fields, HaveTheirNamesInOrder) {
  std::string names;
  Whole::Fields([&](const char* name) { names += std::string(name) + " "; });
  EXPECT_EQ(names, "number text list ");
}

TEST(Fields, AreVisitedTogetherWithThoseOfAnotherStruct) {
  const Whole from{3, "x", {}};
  WithOneForgotten to;
  WithOneForgotten::Fields([](const char*, auto& a, const auto& b) { a = b; }, to, from);
  EXPECT_EQ(to.number, 3);
}

}  // namespace
}  // namespace tiltproof
