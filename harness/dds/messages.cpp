#include "harness/dds/messages.h"

#include "link/check.h"

namespace tiltproof::dds {

std::string_view Name(NodeKind kind) {
  switch (kind) {
    case NodeKind::kHarness:
      return "harness";
    case NodeKind::kPlant:
      return "plant";
    case NodeKind::kLink:
      return "link";
    case NodeKind::kClient:
      return "client";
    case NodeKind::kBaseStation:
      return "base_station";
    case NodeKind::kJoystick:
      return "joystick";
    case NodeKind::kMonitor:
      return "monitor";
    case NodeKind::kLine:
      return "line";
  }
  ThrowBrokenInvariant("a kind of node");
}

std::string_view Name(Verb verb) {
  switch (verb) {
    case Verb::kPrepare:
      return "prepare";
    case Verb::kArm:
      return "arm";
    case Verb::kStart:
      return "start";
    case Verb::kStop:
      return "stop";
    case Verb::kRelease:
      return "release";
    case Verb::kInject:
      return "inject";
  }
  ThrowBrokenInvariant("a verb");
}

std::string_view Name(Phase phase) {
  switch (phase) {
    case Phase::kIdle:
      return "idle";
    case Phase::kPrepared:
      return "prepared";
    case Phase::kArmed:
      return "armed";
    case Phase::kRunning:
      return "running";
    case Phase::kFinished:
      return "finished";
    case Phase::kFailed:
      return "failed";
  }
  ThrowBrokenInvariant("a phase");
}

}  // namespace tiltproof::dds
