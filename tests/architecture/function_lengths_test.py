#!/usr/bin/env python3
"""Tests of function_lengths.py: what it finds in sources that are written out here."""
import sys
import unittest

sys.dont_write_bytecode = True
from function_lengths import functions  # noqa: E402


class FunctionLengths(unittest.TestCase):
    def found(self, text):
        return [(name, lines) for name, _, lines in functions(text)]

    def test_counts_from_the_signature_to_the_bracket(self):
        self.assertEqual(list(functions("// A remark {\n\nint F(int a,\n      int b) {\n  return a;\n}\n")), [("F", 3, 4)])
        self.assertEqual(self.found("int F() { return 1; }\nint G();\nint H()\n{\n}\n"), [("F", 1), ("H", 3)])

    def test_scopes_are_no_functions(self):
        self.assertEqual(self.found("""
namespace a::b {
namespace {
extern "C" {
class X final : public Y<int> {
 public:
  X() : x_{1}, y_(2) {
    Do();
  }
  int Get() const override { return x_; }
  bool operator==(const X& o) const {
    return true;
  }
  struct Point {
    int x = 0;
  };
 private:
  int x_{3};
};
enum class E : std::uint8_t { kA, kB };
}
}
}
"""), [("X", 3), ("Get", 1), ("operator==", 3)])

    def test_data_are_no_functions(self):
        self.assertEqual(self.found("""
constexpr auto kTable = std::to_array<Row>(
    {{1, 2},
     {3, 4}});
const std::map<int, int> kMap = {
    {1, 2},
};
struct stat status {};
int table[] = {1, 2};
"""), [])

    def test_templates_macros_and_lambdas(self):
        self.assertEqual(self.found("""
template <typename T = std::vector<int>, int N = F(3)>
  requires(N > 2)
auto G(T t) -> std::vector<T> {
  const auto inner = [&](int x) {
    return x;
  };
  return {};
}
const auto kLambda = [](int x) {
  return x;
};
TEST_F(Fixture, Name) {
  if (x) {
  }
}
#define MANY(X) \\
  X(a) {
struct stat Read() {
}
"""), [("G", 8), ("const auto kLambda = [](int x)", 3), ("TEST_F", 4), ("Read", 2)])

    def test_brackets_in_texts_do_not_count(self):
        self.assertEqual(self.found("""
void F() {
  Print("{{", '{', '\\'', u8R"x(} " {)x", 1'000, 0xFF'00);  // }
  /* } */
}
void G() {}
"""), [("F", 4), ("G", 1)])


if __name__ == "__main__":
    unittest.main()
