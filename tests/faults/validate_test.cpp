// Problems that the scenario reader gets to report.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "faults/registry.h"
#include "harness/scenario/shipped_protocols.h"
#include "tests/faults/faulty_line.h"
#include "tests/faults/says.h"

namespace tiltproof::faults {
namespace {

using ::testing::IsEmpty;

FaultSpec Valid() { return Spec("wire.bit_error", {{"ber", 0.001}}); }

TEST(ValidateTest, SuggestsTheNearestName) {
  EXPECT_THAT(Validate(Valid()), IsEmpty());
  EXPECT_THAT(Validate(Spec("wire.bit_eror")), Says("type", "did you mean 'wire.bit_error'?"));
  EXPECT_THAT(Validate(Spec("gremlin")), Says("type", "known: wire.bit_error, "));
  FaultSpec spec =
      Spec("wire.burst", {{"lenght_bits", 8.0}, {"length_bits", 8.0}, {"density", 1.0}, {"rate_hz", 1.0}});
  EXPECT_THAT(Validate(spec), Says("parameters.lenght_bits", "did you mean 'length_bits'?"));
  EXPECT_THAT(Validate(Spec("sensor.freeze", {{"signal", "roll rad"}})),
              Says("parameters.signal", "must be the name of a signal"));
  EXPECT_THAT(Validate(Spec("harness.null", {{"level", 1.0}})), Says("parameters.level", "takes none"));
}

TEST(ValidateTest, NamesWhatIsMissingAndTheRange) {
  EXPECT_THAT(Validate(Spec("wire.bit_error")), Says("parameters", "'ber' (bit error ratio"));
  EXPECT_THAT(Validate(Spec("wire.bit_error", {{"ber", 2.0}})), Says("parameters.ber", "between 0 and 1"));
  EXPECT_THAT(Validate(Spec("wire.bit_error", {{"ber", "much"}})), Says("parameters.ber", "number"));
  EXPECT_THAT(Validate(Spec("frame.reorder", {{"probability", 1.0}, {"depth_count", 1.5}})),
              Says("parameters.depth_count", "whole"));
}

TEST(ValidateTest, ChecksWindowAndTrigger) {
  FaultSpec spec = Valid();
  spec.start_ns = 5;
  spec.end_ns = 5;
  EXPECT_THAT(Validate(spec), Says("end_s", "after"));
  spec = Valid();
  spec.every_nth_count = 0;
  EXPECT_THAT(Validate(spec), Says("every_nth_count", "at least 1"));
  spec = Valid();
  spec.probability = 1.5;
  EXPECT_THAT(Validate(spec), Says("probability", "between 0 and 1"));
  spec.probability = std::nan("");
  EXPECT_THAT(Validate(spec), Says("probability", "between 0 and 1"));
  spec = Valid();
  spec.id.clear();
  EXPECT_THAT(Validate(spec), Says("id", "empty"));
}

TEST(ValidateTest, AMessageMustTravelOnTheTarget) {
  const link::Protocol& paper = *harness::FindProtocol("paper");
  const auto problem = [&](const FaultSpec& spec) {
    return MessageProblem(spec, *FindFaultType(spec.type), paper);
  };
  FaultSpec spec = Valid();
  EXPECT_EQ(problem(spec), "");
  spec.message = "reply";
  EXPECT_EQ(problem(spec), "");
  spec.message = "actuators";
  EXPECT_EQ(problem(spec), "'actuators' does not travel there (target to_client); what does: reply");
  spec.target = Target::kBoth;
  EXPECT_EQ(problem(spec), "");
  spec.message = "nothing";
  EXPECT_EQ(problem(spec),
            "the protocol 'paper' has no message 'nothing'; known: start, request, actuators, reply");
  spec = Spec("link.silence");
  spec.target = Target::kNone;  // both by default
  spec.message = "start";
  EXPECT_EQ(problem(spec), "");
  EXPECT_THAT(Validate(spec), IsEmpty());
  spec = Spec("sensor.freeze", {{"signal", "x_m"}});
  spec.message = "reply";
  EXPECT_THAT(Validate(spec), Says("message", "takes no message"));
}

// A role names a message only where no other has it.
TEST(ValidateTest, AMessageIsFoundByItsNameOrItsRole) {
  link::Protocol two = *harness::FindProtocol("paper");
  EXPECT_EQ(FindMessage(two, "sensors"), two.Find("request"));
  link::MessageType baro = {
      .name = "baro", .kind = link::MessageKind::kReply, .direction = link::Direction::kToClient};
  two.messages.push_back(baro);
  two.messages[3].name = "imu";
  EXPECT_EQ(FindMessage(two, "baro"), &two.messages.back());
  EXPECT_EQ(FindMessage(two, "imu"), &two.messages[3]);
  EXPECT_EQ(FindMessage(two, "reply"), nullptr);
  EXPECT_EQ(FindMessage(two, ""), nullptr);
}

// In a stream the server answers nothing: `reply` is what it sends by itself, if that is one message.
TEST(ValidateTest, ReplyIsTheOnlyMessageOfAStream) {
  link::Protocol stream = *harness::FindProtocol("paper");
  for (link::MessageType& type : stream.messages)
    if (type.kind == link::MessageKind::kReply) {
      type.kind = link::MessageKind::kStreamed;
      type.name = "state";
    }
  EXPECT_EQ(FindMessage(stream, "reply"), stream.Find("state"));
  stream.messages.push_back(
      {.name = "baro", .kind = link::MessageKind::kStreamed, .direction = link::Direction::kToClient});
  EXPECT_EQ(FindMessage(stream, "reply"), nullptr);
  // Beside a true reply it is not meant.
  stream.messages.push_back(
      {.name = "answer", .kind = link::MessageKind::kReply, .direction = link::Direction::kToClient});
  EXPECT_EQ(FindMessage(stream, "reply"), &stream.messages.back());
}

TEST(ValidateTest, ATargetIsStatedWhereThereIsNoDefault) {
  FaultSpec spec = Valid();
  spec.target = Target::kNone;
  EXPECT_THAT(Validate(spec), Says("target", "to_client, to_plant, both, reference"));
  spec = Spec("sensor.freeze", {{"signal", "x_m"}});
  spec.target = Target::kToClient;
  EXPECT_THAT(Validate(spec), Says("target", "takes no target"));
}

}  // namespace
}  // namespace tiltproof::faults
