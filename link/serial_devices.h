// The machine's report about its serial devices, made without opening them. Opening one raises DTR, which
// resets many boards. Used for messages about a port that cannot be opened, and to check the machine before a
// flight.
//
//   for (const auto& device : ListSerialDevices()) ...           // "/dev/ttyUSB0", "/dev/serial/by-id/usb-FTDI_..."
//   for (const auto& holder : ProcessesHolding("/dev/ttyUSB0")) ... // {1234, "picocom"}
//
// `root` is put before /dev and /sys: a folder other than "/" is a simulated machine.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tiltproof::link {

// /dev/ttyUSB*, /dev/ttyACM*, /dev/ttyAMA*, then /dev/serial/by-id/*; each group in order of name.
std::vector<std::string> ListSerialDevices(const std::filesystem::path& root = "/");

struct Holder {
  pid_t pid = 0;
  std::string name;  // of the program, at most 15 characters
};
// Processes that have the device open, by process id, as far as /proc shows them.
std::vector<Holder> ProcessesHolding(const std::filesystem::path& device);
// The process that made a pseudo-terminal, and so represents its other end; nullopt for other devices, and
// where /proc does not tell.
std::optional<pid_t> ProcessBehind(const std::filesystem::path& pseudo_terminal);
// "1234 (picocom), 99 (cat)"; empty for none.
std::string Text(const std::vector<Holder>& holders);

// Advice for a device that may not be opened, as commands: join its group, or first give it a group that may.
std::string PermissionAdvice(const std::filesystem::path& device);

// The time for which an FTDI adapter holds received bytes back, in ms (16 by default, 1 to 255):
// sysfs file `latency_timer`. `device` may be a link to it. nullopt: the adapter has no such file.
std::filesystem::path LatencyTimerFile(const std::filesystem::path& device,
                                       const std::filesystem::path& root = "/");
std::optional<int> ReadLatencyTimer(const std::filesystem::path& device,
                                    const std::filesystem::path& root = "/");

}  // namespace tiltproof::link
