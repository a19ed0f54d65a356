// Values of --client: reading them, writing them back, and messages about mistakes in them.

#include "harness/scenario/client_spec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <filesystem>

namespace tiltproof::harness {
namespace {

using testing::HasSubstr;

std::string Mistake(const std::string& text) {
  try {
    return "none: " + ToText(ParseClient(text));
  } catch (const ClientMistake& mistake) {
    return mistake.what();
  }
}

TEST(ClientSpec, EveryFormIsRead) {
  const std::string here = std::filesystem::current_path().string() + "/";
  EXPECT_EQ(ParseClient("host"), ClientSpec(HostLibrary{}));
  EXPECT_EQ(ParseClient("library:a.so"), ClientSpec(HostLibrary{here + "a.so"}));
  EXPECT_EQ(ParseClient("qemu"), ClientSpec(EmulatedImage{}));
  EXPECT_EQ(ParseClient("qemu:executive"), ClientSpec(EmulatedImage{}));
  EXPECT_EQ(ParseClient("qemu:freertos,console=usart6"),
            ClientSpec(EmulatedImage{.file = "", .scheduler = "freertos", .console_usart = 6}));
  EXPECT_EQ(ParseClient("qemu:x.elf,main=usart4,reference=usart5"),
            ClientSpec(EmulatedImage{.file = here + "x.elf", .main_usart = 4, .reference_usart = 5}));
  EXPECT_EQ(ParseClient("qemu:freertos,hse=25000000"),
            ClientSpec(EmulatedImage{.file = "", .scheduler = "freertos", .hse_hz = 25'000'000}));
  EXPECT_EQ(ParseClient("qemu:x.elf,cross=usart6,other=usart4"),
            ClientSpec(EmulatedImage{.file = here + "x.elf", .line_usarts = {{"cross", 6}, {"other", 4}}}));
  EXPECT_EQ(ParseClient("process:./a --b=c:d,e"), ClientSpec(Program{"./a --b=c:d,e"}));
  EXPECT_EQ(ParseClient("program:A=1 ./a {b} | c"), ClientSpec(LockstepProgram{"A=1 ./a {b} | c"}));
  EXPECT_EQ(ParseClient("serial:/dev/ttyUSB0"), ClientSpec(SerialBoard{"/dev/ttyUSB0", ""}));
  EXPECT_EQ(ParseClient("serial:unix:/a,unix:@b"), ClientSpec(SerialBoard{"unix:/a", "unix:@b"}));
}

TEST(ClientSpec, ShippedImagesKnowTheUsartsOfTheirLines) {
  const auto usart = [](const char* text, const char* line, std::size_t index) {
    return LineUsart(std::get<EmulatedImage>(ParseClient(text)), line, index);
  };
  EXPECT_EQ(usart("qemu", "cross", 0), 6);
  EXPECT_EQ(usart("qemu:executive,hse=8000400", "other", 1), 4);
  EXPECT_EQ(usart("qemu", "third", 2), std::nullopt);
  EXPECT_EQ(usart("qemu:x.elf", "cross", 0), std::nullopt);
  EXPECT_EQ(usart("qemu:x.elf,cross=usart5", "cross", 0), 5);
  EXPECT_EQ(usart("qemu:executive,cross=usart4", "other", 1), std::nullopt);
}

TEST(ClientSpec, ThePlainTextIsTheShortest) {
  for (const char* text : {"host", "qemu", "qemu:freertos", "qemu:/x.elf,main=usart6", "qemu:executive,hse=0",
                           "qemu:/x.elf,cross=usart6,other=usart4,hse=0", "library:/a/b.so",
                           "process:sleep 1", "program:sleep 1", "serial:/dev/a", "serial:/dev/a,/dev/b"})
    EXPECT_EQ(ToText(ParseClient(text)), text);
  EXPECT_EQ(ToText(ParseClient("qemu:executive,main=usart2")), "qemu");
}

RC_GTEST_PROP(ClientSpec, TheTextReadsBackAsTheSame, ()) {
  const auto word = *rc::gen::nonEmpty(rc::gen::container<std::string>(rc::gen::inRange('a', 'z')));
  const auto usarts = *rc::gen::unique<std::vector<int>>(3, rc::gen::inRange(1, 7));
  const ClientSpec client = *rc::gen::element<ClientSpec>(
      HostLibrary{"/" + word}, EmulatedImage{"/" + word, "executive", usarts[0], usarts[1], usarts[2]},
      EmulatedImage{"", "freertos", usarts[0], usarts[1], usarts[2]}, Program{word + ":," + word},
      LockstepProgram{word + ":," + word}, SerialBoard{word, ""}, SerialBoard{"unix:" + word, word},
      SerialBoard{word, "", {{word, "/dev/" + word + "=1"}}},
      SerialBoard{word, word, {{"a", word}, {"b_2", word}}, word + ",a=b"});
  RC_ASSERT(ParseClient(ToText(client)) == client);
}

TEST(ClientSpec, AMistakeSaysWhatToWrite) {
  EXPECT_THAT(Mistake("qemu:executive,hse=25"),
              HasSubstr("in Hz, from 1000000 to 50000000, or 0 (no crystal); 25 MHz are hse=25000000"));
  EXPECT_EQ(Mistake("process:./a {port} {reference_port} {baud}"),
            "none: process:./a {port} {reference_port} {baud}");
  EXPECT_EQ(Mistake("process:./a {ports}"),
            "unknown placeholder {ports}, did you mean {port}? There are {port}, {reference_port}, {baud}");
  EXPECT_THAT(Mistake("process:./a {port} {PORT}"), HasSubstr("did you mean {port}?"));
  EXPECT_THAT(Mistake("process:./a {port} {refrence_port}"), HasSubstr("did you mean {reference_port}?"));
  // The shell's own.
  for (const char* shells : {"process:./a ${PORT}", "process:awk '{print $1}'", "process:awk '{print}'",
                             "process:a {x} {", "process:{ a; }"})
    EXPECT_EQ(Mistake(shells), std::string("none: ") + shells);
  for (const char* hse : {"", "8MHz", "-1", "50000001", "8000", "999999"})
    EXPECT_THAT(Mistake("qemu:executive,hse=" + std::string(hse)), HasSubstr("is not hse=HZ"));
  EXPECT_THAT(Mistake("serail:/dev/x"), HasSubstr("unknown kind 'serail', did you mean serial?"));
  EXPECT_THAT(Mistake("hots"), HasSubstr("did you mean host?"));
  // Far from all: it says what there is.
  for (const ClientForm& form : ClientForms())
    EXPECT_THAT(Mistake("nonsense"), HasSubstr(std::string(form.form)));
  EXPECT_THAT(Mistake("host:/x.so"), HasSubstr("library:FILE"));
  EXPECT_EQ(Mistake("serial:"), "names nothing");
  EXPECT_EQ(Mistake("library"), "names nothing");
  EXPECT_EQ(Mistake("program: "), "names nothing");
  EXPECT_THAT(Mistake("serial:a,b,c"), HasSubstr("serial:DEVICE,DEVICE"));
  EXPECT_THAT(Mistake("serial:a,b,cross="), HasSubstr("cross= needs a device"));
  EXPECT_THAT(Mistake("serial:a,cross=b,cross=c"), HasSubstr("'cross' has a device already"));
  EXPECT_EQ(Mistake("process:./a {port} {cross_port}"), "none: process:./a {port} {cross_port}");
  EXPECT_THAT(Mistake("serial:a,reset="), HasSubstr("reset=st-flash reset"));
  EXPECT_THAT(Mistake("serial:,reset=dtr"), HasSubstr("serial:DEVICE"));
  EXPECT_THAT(Mistake("qemu,main=usart1"), HasSubstr("qemu:executive,main=usart1"));
  EXPECT_THAT(Mistake("qemu:"), HasSubstr("qemu:FILE.elf"));
  EXPECT_THAT(Mistake("qemu:x.elf,main=usart9"), HasSubstr("N from 1 to 6"));
  EXPECT_THAT(Mistake("qemu:x.elf,main=usart3"), HasSubstr("a USART each"));
  EXPECT_THAT(Mistake("qemu:x.elf,cross=usart3"),
              HasSubstr("reference and cross need a USART each; both are on 3"));
  EXPECT_THAT(Mistake("qemu:x.elf,cross=usart4,other=usart4"), HasSubstr("both are on 4"));
  EXPECT_THAT(Mistake("qemu:x.elf,cross=usart4,cross=usart5"), HasSubstr("'cross' has a USART already"));
  EXPECT_THAT(Mistake("qemu:x.elf,cross=4"), HasSubstr("LINE=usartN"));
}

TEST(ClientSpec, TheKindAloneComesBack) {
  for (const char* text : {"host", "qemu:/x.elf", "process:a", "serial:a", "program:a"}) {
    const ClientSpec client = ParseClient(text);
    const auto kind = ClientOfKind(KindOf(client));
    ASSERT_TRUE(kind.has_value()) << text;
    EXPECT_EQ(kind->index(), client.index()) << text;
  }
  EXPECT_FALSE(ClientOfKind("").has_value());
}

}  // namespace
}  // namespace tiltproof::harness
