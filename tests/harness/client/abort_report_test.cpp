#include <gtest/gtest.h>

#include "harness/client/sanitizer.h"

namespace tiltproof::harness {
namespace {

TEST(AbortReport, NamesThePlaceOfAnAddressSanitizersReport) {
  AbortReport report;
  report.Look("==7==ERROR: AddressSanitizer: heap-buffer-overflow on address 0x60200001 at pc 0x7f");
  EXPECT_FALSE(report.names_place());
  report.Look("    #0 0x7f01 in __interceptor_memcpy ../../../libsanitizer/memcpy.inc:827");
  report.Look("    #1 0x7f0c in Decode /mine/decoder.c:33");
  report.Look("    #2 0x7f0d in Receive /mine/decoder.c:80");
  EXPECT_TRUE(report.names_place());
  EXPECT_EQ(report.place(), "/mine/decoder.c:33");
}

TEST(AbortReport, NamesTheOffsetInALibraryWithoutLines) {
  AbortReport report;
  report.Look("==7==ERROR: AddressSanitizer: SEGV on unknown address 0x0");
  report.Look("    #0 0x7f0c in Decode (/mine/decoder.so+0x1a2b) (BuildId: 0123)");
  EXPECT_EQ(report.place(), "/mine/decoder.so+0x1a2b");
}

TEST(AbortReport, NamesThePlaceOfUndefinedBehaviourWithItsColumn) {
  AbortReport report;
  report.Look("x.c:33:4: runtime error: index 80 out of bounds");
  EXPECT_EQ(report.place(), "x.c:33:4");
}

TEST(AbortReport, NamesThePlaceOfAnAssertionAndNoneOfADamagedHeap) {
  AbortReport report;
  report.Look("decoder.c:12: Decode: Assertion `size < 80' failed.");
  EXPECT_EQ(report.place(), "decoder.c:12");
  report.Look("free(): invalid next size (fast)");
  EXPECT_FALSE(report.names_place());
  EXPECT_EQ(report.place(), "") << "the last report counts";
}

TEST(AbortReport, NamesTheInnermostPlaceOfAPythonException) {
  AbortReport report;
  for (const char* line :
       {"Traceback (most recent call last):", "  File \"/mine/fw.py\", line 40, in <module>", "    main()",
        "  File \"/mine/law.py\", line 7, in step", "    return 1 / x",
        "ZeroDivisionError: division by zero"})
    report.Look(line);
  EXPECT_EQ(report.text(), "ZeroDivisionError: division by zero at /mine/law.py:7");
  EXPECT_EQ(report.place(), "/mine/law.py:7");
  report.Look("printed later");
  EXPECT_EQ(report.place(), "/mine/law.py:7");
}

TEST(AbortReport, NamesThePlacesOfRustAndAda) {
  AbortReport report;
  report.Look("thread 'main' panicked at 'index out of bounds', src/main.rs:31:9");
  EXPECT_EQ(report.place(), "src/main.rs:31:9");
  report.Look("raised CONSTRAINT_ERROR : law.adb:12 range check failed");
  EXPECT_EQ(report.place(), "law.adb:12");
  EXPECT_EQ(report.text(), "raised CONSTRAINT_ERROR : law.adb:12 range check failed");
}

}  // namespace
}  // namespace tiltproof::harness
