// The pilot's sticks, from a device or from a recording: four axes in -1..1, at any time.
// joystick_reference.h gives them their meaning for the vehicle.
//
//   auto input = OpenJoystick("/dev/input/js0");     // or /dev/input/event5, or a recording
//   JoystickAxes axes = input->Read(now);            // once a period; never blocks
//   if (!input->lost().empty()) ...                  // unplugged: the axes are centred from then on
//
// Devices speak one of two protocols of the kernel: /dev/input/js* (struct js_event) or /dev/input/event*
// (struct input_event). Sticks of a gamepad as Linux numbers their axes in both: left stick forward = vx,
// left stick left = vy, right stick forward = vz (up), right stick left = yaw_rate.
//
// A recording is text, one change of one axis per line, in order of time; an axis keeps its value until its
// next line:
//   # t_s axis value        axis: vx, vy, vz, yaw_rate; value: -1 to 1
//   0.5   vx   0.3
//   2     vx   0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "link/time.h"

namespace tiltproof::harness {

// Positions of the sticks, -1..1; 0 is centred. Positive is forward, left, up, counter-clockwise.
struct JoystickAxes {
  double vx = 0.0, vy = 0.0, vz = 0.0, yaw_rate = 0.0;
  friend bool operator==(const JoystickAxes&, const JoystickAxes&) = default;
};

class JoystickInput {
 public:
  virtual ~JoystickInput() = default;
  // The axes at `time_ns` (a recording: since its beginning; a device: now). Times may come in any order.
  virtual JoystickAxes Read(TimeNs time_ns) = 0;
  // Reason that no more input comes; empty while it comes.
  virtual std::string lost() const { return {}; }
};

// A recording if `path` is an ordinary file. Throws std::runtime_error that says what is wrong with the
// device, or "file:line: message", and what to do.
std::unique_ptr<JoystickInput> OpenJoystick(const std::filesystem::path& path);

// The text of a recording; `name` identifies it in messages. Throws std::runtime_error.
std::unique_ptr<JoystickInput> ParseRecording(std::string_view text, const std::string& name);

enum class JoystickProtocol { kJoystick, kEvent };

// End points of an axis of an event device (EVIOCGABS); the centre is in the middle.
struct AxisRange {
  std::int32_t min = -32767, max = 32767;
};

// Converts bytes of a device to axes, in any pieces. Events of other kinds and axes are ignored; an
// incomplete event waits for its rest.
class JoystickDecoder {
 public:
  // `ranges` by axis code (ABS_X, ...): only for event devices; axes without a range are taken as
  // -32767..32767.
  explicit JoystickDecoder(JoystickProtocol protocol, std::map<int, AxisRange> ranges = {});

  void Decode(std::span<const std::uint8_t> bytes);
  JoystickAxes axes() const { return axes_; }

  // An axis has this raw value now, as known by other means than events.
  void Set(int axis, std::int32_t value);
  // The kernel has dropped events (SYN_DROPPED) since the last call: ask it for the values of the axes.
  bool TakeDropped();

 private:
  void HandleEvent();

  JoystickProtocol protocol_;
  std::map<int, AxisRange> ranges_;
  JoystickAxes axes_;
  bool dropped_ = false;
  std::array<std::uint8_t, 24> event_{};  // the longer of the two
  std::size_t event_size_;
  std::size_t filled_ = 0;
};

// A device that is open already (non-blocking; any descriptor is accepted): closed with the object.
std::unique_ptr<JoystickInput> AdoptJoystick(int descriptor, JoystickDecoder decoder,
                                             const std::string& name);

}  // namespace tiltproof::harness
