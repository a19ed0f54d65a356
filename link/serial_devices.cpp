#include "link/serial_devices.h"

#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>

namespace tiltproof::link {
namespace {

namespace fs = std::filesystem;

// Calls visit(entry) for every entry of a folder that can be read; processes and devices come and go
// meanwhile.
template <class Visit>
void ForEachEntry(const fs::path& folder, Visit&& visit) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error); !error && entry != fs::directory_iterator();
       entry.increment(error))
    visit(*entry);
}

std::optional<int> ToNumber(std::string_view text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

std::vector<std::string> ListSerialDevices(const fs::path& root) {
  constexpr std::array<std::string_view, 3> kPrefixes = {"ttyUSB", "ttyACM", "ttyAMA"};
  std::vector<std::string> devices;
  ForEachEntry(root / "dev", [&](const fs::directory_entry& entry) {
    const std::string name = entry.path().filename();
    if (std::any_of(kPrefixes.begin(), kPrefixes.end(),
                    [&](std::string_view prefix) { return name.starts_with(prefix); }))
      devices.push_back(entry.path());
  });
  std::vector<std::string> by_id;
  ForEachEntry(root / "dev/serial/by-id",
               [&](const fs::directory_entry& entry) { by_id.push_back(entry.path()); });
  std::sort(devices.begin(), devices.end());
  std::sort(by_id.begin(), by_id.end());
  devices.insert(devices.end(), by_id.begin(), by_id.end());
  return devices;
}

std::vector<Holder> ProcessesHolding(const fs::path& device) {
  std::error_code error;
  const fs::path wanted = fs::canonical(device, error);
  std::vector<Holder> holders;
  if (error) return holders;
  ForEachEntry("/proc", [&](const fs::directory_entry& process) {
    const auto pid = ToNumber(process.path().filename().native());
    if (!pid) return;
    bool holds = false;
    ForEachEntry(process.path() / "fd", [&](const fs::directory_entry& descriptor) {
      std::error_code gone;
      holds = holds || fs::read_symlink(descriptor.path(), gone) == wanted;
    });
    if (!holds) return;
    Holder holder{*pid, "?"};
    std::ifstream(process.path() / "comm") >> holder.name;
    holders.push_back(std::move(holder));
  });
  std::sort(holders.begin(), holders.end(), [](const auto& a, const auto& b) { return a.pid < b.pid; });
  return holders;
}

std::optional<pid_t> ProcessBehind(const fs::path& pseudo_terminal) {
  std::error_code error;
  const fs::path slave = fs::canonical(pseudo_terminal, error);
  const auto index = ToNumber(slave.filename().native());
  if (error || slave.parent_path() != "/dev/pts" || !index) return std::nullopt;
  for (const Holder& holder : ProcessesHolding("/dev/ptmx")) {
    bool behind = false;
    ForEachEntry(fs::path("/proc") / std::to_string(holder.pid) / "fdinfo",
                 [&](const fs::directory_entry& entry) {
                   std::ifstream file(entry.path());
                   for (std::string line; std::getline(file, line);) {
                     std::istringstream words(line);
                     std::string key;
                     int number = -1;
                     behind = behind || (words >> key >> number && key == "tty-index:" && number == *index);
                   }
                 });
    if (behind && holder.pid != getpid()) return holder.pid;
  }
  return std::nullopt;
}

std::string Text(const std::vector<Holder>& holders) {
  std::string text;
  for (const auto& holder : holders)
    text += (text.empty() ? "" : ", ") + std::to_string(holder.pid) + " (" + holder.name + ")";
  return text;
}

std::string PermissionAdvice(const std::filesystem::path& device) {
  const auto join = [](const std::string& group) {
    return "`sudo usermod -aG " + group + " $USER`, then log out and in again";
  };
  struct stat status {};
  if (stat(device.c_str(), &status) != 0) return join("dialout");
  constexpr mode_t kReadWrite = S_IRGRP | S_IWGRP;
  const struct group* group = getgrgid(status.st_gid);
  if (status.st_gid != 0 && group != nullptr && (status.st_mode & kReadWrite) == kReadWrite)
    return join(group->gr_name);
  const struct passwd* owner = getpwuid(status.st_uid);
  // root's own group is no way in.
  return "`sudo chgrp dialout " + device.string() + " && sudo chmod g+rw " + device.string() +
         "` (it belongs to " + (owner != nullptr ? owner->pw_name : std::to_string(status.st_uid)) + ":" +
         (group != nullptr ? group->gr_name : std::to_string(status.st_gid)) +
         ", and no group that you could join may use it; a udev rule, docs/board.md, makes it last), " +
         join("dialout");
}

fs::path LatencyTimerFile(const fs::path& device, const fs::path& root) {
  std::error_code error;
  fs::path target = fs::canonical(device, error);
  if (error) target = device;
  return root / "sys/class/tty" / target.filename() / "device/latency_timer";
}

std::optional<int> ReadLatencyTimer(const fs::path& device, const fs::path& root) {
  std::ifstream file(LatencyTimerFile(device, root));
  std::string text;
  if (!(file >> text)) return std::nullopt;
  return ToNumber(text);
}

}  // namespace tiltproof::link
