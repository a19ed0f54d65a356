#include "harness/node/joystick_input.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/input.h>
#include <linux/joystick.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <vector>

namespace tiltproof::harness {
namespace {

using testing::HasSubstr;
using testing::StartsWith;
using Bytes = std::vector<std::uint8_t>;

template <class Event>
Bytes BytesOf(const Event& event) {
  Bytes bytes(sizeof event);
  std::memcpy(bytes.data(), &event, sizeof event);
  return bytes;
}
Bytes Joystick(std::uint8_t type, std::uint8_t number, std::int16_t value) {
  return BytesOf(js_event{.time = 99, .value = value, .type = type, .number = number});
}
Bytes Event(std::uint16_t type, std::uint16_t code, std::int32_t value) {
  input_event event{};
  event.type = type, event.code = code, event.value = value;
  return BytesOf(event);
}

std::string ErrorOf(const std::function<void()>& work) {
  try {
    work();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no error";
}
std::string ParseError(const std::string& text) {
  return ErrorOf([&] { ParseRecording(text, "hand.txt"); });
}

TEST(JoystickDecoder, SticksOfAJoystickDevice) {
  JoystickDecoder decoder(JoystickProtocol::kJoystick);
  EXPECT_EQ(decoder.axes(), JoystickAxes{});
  decoder.Decode(Joystick(JS_EVENT_AXIS | JS_EVENT_INIT, 1, -32767));  // left stick forward
  EXPECT_DOUBLE_EQ(decoder.axes().vx, 1.0);
  decoder.Decode(Joystick(JS_EVENT_AXIS, 1, 32767));
  EXPECT_DOUBLE_EQ(decoder.axes().vx, -1.0);
  decoder.Decode(Joystick(JS_EVENT_AXIS, 0, -16384));  // left stick half left
  EXPECT_NEAR(decoder.axes().vy, 0.5, 1e-4);
  decoder.Decode(Joystick(JS_EVENT_AXIS, 4, -32768));  // one more than the end point
  EXPECT_DOUBLE_EQ(decoder.axes().vz, 1.0);
  decoder.Decode(Joystick(JS_EVENT_AXIS, 3, 32767));  // right stick right: clockwise
  EXPECT_DOUBLE_EQ(decoder.axes().yaw_rate, -1.0);
}

TEST(JoystickDecoder, SticksOfAnEventDeviceWithItsRanges) {
  JoystickDecoder decoder(JoystickProtocol::kEvent,
                          {{ABS_X, {0, 255}}, {ABS_Y, {-100, 300}}, {ABS_RX, {5, 5}}});
  decoder.Decode(Event(EV_ABS, ABS_X, 0));
  EXPECT_DOUBLE_EQ(decoder.axes().vy, 1.0);
  decoder.Decode(Event(EV_ABS, ABS_X, 255));
  EXPECT_DOUBLE_EQ(decoder.axes().vy, -1.0);
  decoder.Decode(Event(EV_ABS, ABS_Y, 100));
  EXPECT_DOUBLE_EQ(decoder.axes().vx, 0.0);
  decoder.Decode(Event(EV_ABS, ABS_Y, 2'000'000'000));
  EXPECT_DOUBLE_EQ(decoder.axes().vx, -1.0);
  decoder.Decode(Event(EV_ABS, ABS_RX, 7));  // an empty range says nothing
  EXPECT_DOUBLE_EQ(decoder.axes().yaw_rate, 0.0);
  EXPECT_FALSE(decoder.TakeDropped());
  decoder.Decode(Event(EV_SYN, SYN_DROPPED, 0));
  EXPECT_TRUE(decoder.TakeDropped());
  EXPECT_FALSE(decoder.TakeDropped());
}

TEST(JoystickDecoder, PiecesOfEventsAndOtherKindsDoNoHarm) {
  Bytes stream;
  for (const auto& bytes :
       {Joystick(JS_EVENT_BUTTON, 1, 1), Joystick(JS_EVENT_AXIS, 1, -32767), Joystick(0x55, 1, 12'345),
        Joystick(JS_EVENT_AXIS, 200, 77), Joystick(JS_EVENT_AXIS, 2, 77), Joystick(JS_EVENT_AXIS, 0, 32767)})
    stream.insert(stream.end(), bytes.begin(), bytes.end());
  for (std::size_t piece = 1; piece <= stream.size(); ++piece) {
    JoystickDecoder decoder(JoystickProtocol::kJoystick);
    for (std::size_t at = 0; at < stream.size(); at += piece)
      decoder.Decode(std::span(stream).subspan(at, std::min(piece, stream.size() - at)));
    EXPECT_EQ(decoder.axes(), (JoystickAxes{1.0, -1.0, 0.0, 0.0})) << piece;
  }
}

TEST(JoystickDecoder, GarbageStaysWithinTheRange) {
  std::uint32_t state = 1;
  for (const auto protocol : {JoystickProtocol::kJoystick, JoystickProtocol::kEvent}) {
    JoystickDecoder decoder(protocol, {{ABS_X, {-2'147'483'647 - 1, 2'147'483'647}}, {ABS_Y, {9, -9}}});
    for (int i = 0; i < 20'000; ++i) {
      Bytes bytes(state % 40);
      for (auto& byte : bytes) {
        state = state * 1'664'525u + 1'013'904'223u;
        byte = static_cast<std::uint8_t>(state >> 30 ? state >> 28 & 3 : state >> 20);  // often small codes
      }
      state = state * 1'664'525u + 1'013'904'223u;
      decoder.Decode(bytes);
      const auto axes = decoder.axes();
      for (const double value : {axes.vx, axes.vy, axes.vz, axes.yaw_rate}) ASSERT_LE(std::abs(value), 1.0);
    }
  }
}

TEST(JoystickDevice, ReadsWhatHasComeAndNeverBlocks) {
  int ends[2];
  ASSERT_EQ(pipe2(ends, O_CLOEXEC | O_NONBLOCK), 0);
  const auto input = AdoptJoystick(ends[0], JoystickDecoder(JoystickProtocol::kJoystick), "js9");
  EXPECT_EQ(input->Read(0), JoystickAxes{});
  const Bytes event = Joystick(JS_EVENT_AXIS, 1, -32767);
  ASSERT_EQ(write(ends[1], event.data(), 5), 5);
  EXPECT_EQ(input->Read(0), JoystickAxes{});
  ASSERT_EQ(write(ends[1], event.data() + 5, 3), 3);
  EXPECT_DOUBLE_EQ(input->Read(0).vx, 1.0);
  EXPECT_DOUBLE_EQ(input->Read(0).vx, 1.0);
  EXPECT_EQ(input->lost(), "");
  close(ends[1]);
  // A vehicle whose pilot's stick is gone stays where it is.
  EXPECT_EQ(input->Read(0), JoystickAxes{});
  EXPECT_THAT(input->lost(), HasSubstr("js9"));
  EXPECT_EQ(input->Read(0), JoystickAxes{});
}

TEST(JoystickRecording, EachAxisKeepsItsValue) {
  const auto input = ParseRecording(
      "# by hand\n\n0.5 vx 0.25\n 1e0\tvz -1 # down\r\n1 yaw_rate 1\n2.012 vx 0\n", "hand.txt");
  EXPECT_EQ(input->Read(FromSeconds(0.499)), JoystickAxes{});
  EXPECT_EQ(input->Read(FromSeconds(0.5)), (JoystickAxes{.vx = 0.25}));
  EXPECT_EQ(input->Read(FromSeconds(1)), (JoystickAxes{0.25, 0, -1, 1}));
  EXPECT_EQ(input->Read(FromSeconds(100)), (JoystickAxes{0, 0, -1, 1}));
  EXPECT_EQ(input->Read(FromSeconds(0.6)), (JoystickAxes{.vx = 0.25}));  // back again
  EXPECT_EQ(input->Read(-1), JoystickAxes{});
  EXPECT_EQ(ParseRecording("", "empty")->Read(0), JoystickAxes{});
}

TEST(JoystickRecording, MistakesAreNamedWithTheirLine) {
  EXPECT_THAT(ParseError("0 vx 0\n1 vx\n"), StartsWith("hand.txt:2: a line is"));
  EXPECT_THAT(ParseError("1 vx 1 1"), StartsWith("hand.txt:1: a line is"));
  EXPECT_THAT(ParseError("\n\nx vx 1"), StartsWith("hand.txt:3: 'x' is not a time"));
  EXPECT_THAT(ParseError("-1 vx 1"), HasSubstr("is not a time"));
  EXPECT_THAT(ParseError("1e30 vx 1"), HasSubstr("is not a time"));
  EXPECT_THAT(ParseError("nan vx 1"), HasSubstr("is not a time"));
  EXPECT_THAT(ParseError("1 throttle 1"), HasSubstr("vx, vy, vz or yaw_rate"));
  EXPECT_THAT(ParseError("1 vx 1.01"), HasSubstr("is not a position from -1 to 1"));
  EXPECT_THAT(ParseError("1 vx inf"), HasSubstr("is not a position"));
  EXPECT_THAT(ParseError("1 vx 0x1"), HasSubstr("is not a position"));
  EXPECT_THAT(ParseError("2 vx 1\n1 vx 0\n"), StartsWith("hand.txt:2: the time 1 s is before"));
}

TEST(OpenJoystick, TakesARecordingAndRefusesWhatIsNoJoystick) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("tiltproof-joystick-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "hand.txt") << "1 vx 1\n";
  EXPECT_DOUBLE_EQ(OpenJoystick(folder / "hand.txt")->Read(kNsPerS).vx, 1.0);
  std::ofstream(folder / "bad.txt") << "1 vx 3\n";
  const auto error = [](const std::filesystem::path& path) { return ErrorOf([&] { OpenJoystick(path); }); };
  EXPECT_THAT(error(folder / "bad.txt"), StartsWith((folder / "bad.txt").string() + ":1: "));
  EXPECT_THAT(error(folder / "js0"), HasSubstr("No such file"));
  EXPECT_THAT(error(folder), HasSubstr("neither"));
  EXPECT_THAT(error("/dev/null"), HasSubstr("no sticks"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace tiltproof::harness
