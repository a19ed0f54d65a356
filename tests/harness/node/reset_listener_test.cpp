#include "harness/node/reset_listener.h"

#include <gtest/gtest.h>

#include <initializer_list>
#include <string>
#include <vector>

#include "harness/scenario/shipped_protocols.h"
#include "link/protocol.h"

namespace tiltproof::harness {
namespace {

using Bytes = std::vector<std::uint8_t>;

struct ResetListenerTest : testing::Test {
  // The frames of these messages of the protocol `paper`, one behind the other.
  Bytes Frames(std::initializer_list<std::string> names) const {
    Bytes bytes;
    for (const std::string& name : names) {
      const link::MessageType& type = *protocol.Find(name);
      const auto payload = protocol.Encode(type, std::vector<double>(type.fields.size(), 1.0));
      const Bytes frame = protocol.framing->Encode(payload.span());
      bytes.insert(bytes.end(), frame.begin(), frame.end());
    }
    return bytes;
  }
  const link::Protocol& protocol = *FindProtocol("paper");
  ResetListener listener{protocol};
};

TEST_F(ResetListenerTest, NothingPassesWhileTheResetLasts) {
  EXPECT_EQ(listener.Hear(Frames({"start", "request", "start"})), Bytes());
  EXPECT_FALSE(listener.passes());
}

TEST_F(ResetListenerTest, EverythingPassesFromTheFirstStartAfterTheResetOn) {
  listener.Hear(Frames({"start"}));
  listener.ResetEnded();
  EXPECT_EQ(listener.Hear(Frames({"request", "start", "request"})), Frames({"start", "request"}));
  EXPECT_TRUE(listener.passes());
}

TEST_F(ResetListenerTest, StartMayBeDividedByTheEndOfTheReset) {
  const Bytes start = Frames({"start"});
  for (std::size_t cut = 1; cut < start.size(); ++cut) {
    ResetListener divided(protocol);
    divided.Hear(std::span(start).first(cut));
    divided.ResetEnded();
    EXPECT_EQ(divided.Hear(std::span(start).subspan(cut)), start) << cut;
  }
}

TEST_F(ResetListenerTest, OneStartDuringTheResetCountsWhenNoneFollows) {
  listener.Hear(Frames({"request", "start", "request"}));
  listener.ResetEnded();
  listener.Hear(Frames({"request"}));
  EXPECT_EQ(listener.GiveUp(), Frames({"start"}));
  EXPECT_TRUE(listener.passes());
}

TEST_F(ResetListenerTest, RepeatedStartDuringTheResetDoesNotCount) {
  listener.Hear(Frames({"start", "start"}));
  listener.ResetEnded();
  EXPECT_EQ(listener.GiveUp(), Bytes());
  EXPECT_TRUE(listener.passes());
}

TEST_F(ResetListenerTest, DamagedStartIsNone) {
  Bytes start = Frames({"start"});
  start[2] ^= 1;
  listener.ResetEnded();
  EXPECT_EQ(listener.Hear(start), Bytes());
}

}  // namespace
}  // namespace tiltproof::harness
