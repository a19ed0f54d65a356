#include "harness/node/joystick_input.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/input.h>
#include <linux/joystick.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace tiltproof::harness {
namespace {

static_assert(sizeof(js_event) == 8 && sizeof(input_event) <= 24);

struct Axis {
  std::string_view name;
  double JoystickAxes::*member;
  int number;  // ABS_X, ABS_Y, ABS_RX, ABS_RY; gamepads number the same ones alike as js axes
};
// Linux counts right and back as positive.
constexpr std::array<Axis, 4> kAxes = {{{"vx", &JoystickAxes::vx, ABS_Y},
                                        {"vy", &JoystickAxes::vy, ABS_X},
                                        {"vz", &JoystickAxes::vz, ABS_RY},
                                        {"yaw_rate", &JoystickAxes::yaw_rate, ABS_RX}}};

constexpr std::uintmax_t kRecordingBytesMax = 64 << 20;
// Pieces of a device's backlog taken in one call: more than it can have, and a bound on the time spent.
constexpr int kPiecesMax = 64;

[[noreturn]] void Refuse(const std::string& name, const std::string& why) {
  throw std::runtime_error(fmt::format("joystick {}: {}", name, why));
}

class Recording final : public JoystickInput {
 public:
  struct Change {
    TimeNs time_ns;
    JoystickAxes axes;  // from then on
  };
  explicit Recording(std::vector<Change> changes) : changes_(std::move(changes)) {}

  JoystickAxes Read(TimeNs time_ns) override {
    const auto next =
        std::upper_bound(changes_.begin(), changes_.end(), time_ns,
                         [](TimeNs time, const Change& change) { return time < change.time_ns; });
    return next == changes_.begin() ? JoystickAxes{} : std::prev(next)->axes;
  }

 private:
  std::vector<Change> changes_;
};

std::optional<double> ToNumber(const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

class Device final : public JoystickInput {
 public:
  Device(int descriptor, JoystickDecoder decoder, std::string name)
      : descriptor_(descriptor), decoder_(std::move(decoder)), name_(std::move(name)) {}
  ~Device() override { close(descriptor_); }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  JoystickAxes Read(TimeNs) override {
    std::array<std::uint8_t, 1536> buffer;  // whole events of both protocols
    for (int i = 0; i < kPiecesMax && lost_.empty(); ++i) {
      const ssize_t count = read(descriptor_, buffer.data(), buffer.size());
      if (count < 0 && errno == EINTR) continue;
      if (count < 0 && errno == EAGAIN) break;
      if (count <= 0) {
        lost_ = fmt::format("joystick {}: was it unplugged? ({})", name_,
                            count == 0 ? "end of file" : std::strerror(errno));
        break;
      }
      decoder_.Decode({buffer.data(), static_cast<std::size_t>(count)});
      if (decoder_.TakeDropped()) ReadValues();
    }
    return lost_.empty() ? decoder_.axes() : JoystickAxes{};
  }
  std::string lost() const override { return lost_; }

  // Event devices only report changes.
  void ReadValues() {
    for (const auto& axis : kAxes) {
      input_absinfo info{};
      if (ioctl(descriptor_, EVIOCGABS(static_cast<unsigned>(axis.number)), &info) >= 0)
        decoder_.Set(axis.number, info.value);
    }
  }

 private:
  int descriptor_;
  JoystickDecoder decoder_;
  std::string name_;
  std::string lost_;
};

std::unique_ptr<JoystickInput> OpenDevice(const std::string& name) {
  const int descriptor = open(name.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) {
    if (errno == EACCES)
      Refuse(name, "no permission: run `sudo usermod -aG input $USER`, then log out and in again");
    Refuse(name, std::strerror(errno));
  }
  std::uint8_t axis_count = 0;
  if (ioctl(descriptor, JSIOCGAXES, &axis_count) >= 0)
    return std::make_unique<Device>(descriptor, JoystickDecoder(JoystickProtocol::kJoystick), name);

  std::map<int, AxisRange> ranges;
  for (const auto& axis : kAxes) {
    input_absinfo info{};
    if (ioctl(descriptor, EVIOCGABS(static_cast<unsigned>(axis.number)), &info) >= 0 &&
        info.minimum < info.maximum)
      ranges[axis.number] = {info.minimum, info.maximum};
  }
  if (ranges.empty()) {
    close(descriptor);
    Refuse(name,
           "it has no sticks; joysticks of this machine: `ls /dev/input/js* /dev/input/by-id/*joystick*`");
  }
  auto device = std::make_unique<Device>(descriptor, JoystickDecoder(JoystickProtocol::kEvent, ranges), name);
  device->ReadValues();
  return device;
}

template <class Event>
Event As(const std::array<std::uint8_t, 24>& bytes) {
  Event event;
  std::memcpy(&event, bytes.data(), sizeof event);
  return event;
}

}  // namespace

JoystickDecoder::JoystickDecoder(JoystickProtocol protocol, std::map<int, AxisRange> ranges)
    : protocol_(protocol),
      ranges_(std::move(ranges)),
      event_size_(protocol == JoystickProtocol::kJoystick ? sizeof(js_event) : sizeof(input_event)) {}

void JoystickDecoder::Decode(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const std::size_t count = std::min(bytes.size(), event_size_ - filled_);
    std::copy_n(bytes.begin(), count, event_.begin() + static_cast<std::ptrdiff_t>(filled_));
    bytes = bytes.subspan(count);
    filled_ += count;
    if (filled_ < event_size_) return;
    filled_ = 0;
    HandleEvent();
  }
}

void JoystickDecoder::HandleEvent() {
  if (protocol_ == JoystickProtocol::kJoystick) {
    const auto event = As<js_event>(event_);
    // With the flag "initial" it says where the axis stood when the device was opened.
    if ((event.type & ~JS_EVENT_INIT) == JS_EVENT_AXIS) Set(event.number, event.value);
    return;
  }
  const auto event = As<input_event>(event_);
  if (event.type == EV_ABS) Set(event.code, event.value);
  if (event.type == EV_SYN && event.code == SYN_DROPPED) dropped_ = true;
}

void JoystickDecoder::Set(int number, std::int32_t value) {
  const auto axis = std::find_if(kAxes.begin(), kAxes.end(),
                                 [&](const Axis& candidate) { return candidate.number == number; });
  if (axis == kAxes.end()) return;
  const auto found = ranges_.find(number);
  const AxisRange range = found != ranges_.end() ? found->second : AxisRange{};
  const double half = (static_cast<double>(range.max) - range.min) / 2.0;
  const double centre = (static_cast<double>(range.max) + range.min) / 2.0;
  // A range of nothing, from a device that lies.
  if (!(half > 0.0)) return;
  axes_.*axis->member = -std::clamp((value - centre) / half, -1.0, 1.0);
}

bool JoystickDecoder::TakeDropped() { return std::exchange(dropped_, false); }

std::unique_ptr<JoystickInput> AdoptJoystick(int descriptor, JoystickDecoder decoder,
                                             const std::string& name) {
  return std::make_unique<Device>(descriptor, std::move(decoder), name);
}

std::unique_ptr<JoystickInput> ParseRecording(std::string_view text, const std::string& name) {
  std::vector<Recording::Change> changes;
  std::istringstream lines{std::string(text)};
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    const auto refuse = [&](const std::string& why) {
      throw std::runtime_error(fmt::format("{}:{}: {}", name, number, why));
    };
    std::istringstream words(line.substr(0, line.find('#')));
    std::string time, axis_name, value, more;
    if (!(words >> time)) continue;
    if (!(words >> axis_name >> value) || words >> more) refuse("a line is `t_s axis value`");
    const auto t_s = ToNumber(time);
    if (!t_s || *t_s < 0.0 || *t_s > 1e6) refuse(fmt::format("'{}' is not a time from 0 to 1000000 s", time));
    if (!changes.empty() && FromSeconds(*t_s) < changes.back().time_ns)
      refuse(fmt::format("the time {} s is before that of the line above", time));
    const auto axis = std::find_if(kAxes.begin(), kAxes.end(),
                                   [&](const Axis& candidate) { return candidate.name == axis_name; });
    if (axis == kAxes.end()) refuse(fmt::format("'{}' is not an axis: vx, vy, vz or yaw_rate", axis_name));
    const auto position = ToNumber(value);
    if (!position || std::abs(*position) > 1.0)
      refuse(fmt::format("'{}' is not a position from -1 to 1", value));
    JoystickAxes axes = changes.empty() ? JoystickAxes{} : changes.back().axes;
    axes.*axis->member = *position;
    changes.push_back({FromSeconds(*t_s), axes});
  }
  return std::make_unique<Recording>(std::move(changes));
}

std::unique_ptr<JoystickInput> OpenJoystick(const std::filesystem::path& path) {
  struct stat status {};
  const std::string name = path.string();
  if (stat(name.c_str(), &status) != 0)
    Refuse(name, fmt::format("{}; joysticks of this machine: `ls /dev/input/js* /dev/input/by-id/*joystick*`",
                             std::strerror(errno)));
  if (S_ISCHR(status.st_mode)) return OpenDevice(name);
  if (!S_ISREG(status.st_mode)) Refuse(name, "neither a device nor a recording");
  if (static_cast<std::uintmax_t>(status.st_size) > kRecordingBytesMax)
    Refuse(name, "longer than any recording (64 MiB)");
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file || file.bad()) Refuse(name, "cannot be read");
  return ParseRecording(text.str(), name);
}

}  // namespace tiltproof::harness
