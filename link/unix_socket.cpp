#include "link/unix_socket.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "link/check.h"

namespace tiltproof::link {
namespace {

constexpr std::string_view kScheme = "unix:";
constexpr const char* kNobody =
    "no process listens there: start the emulator first (QEMU: -chardev socket,...,server=on,wait=off)";

std::string Refusal(const std::string& name, const std::string& why) {
  return "cannot open serial line " + name + ": " + why;
}

struct Address {
  sockaddr_un value{};
  socklen_t size = 0;
};

// Empty text, or why it is no name of a socket.
std::string Parse(const std::string& name, Address& address) {
  Check(IsSocketName(name), "the name of a socket starts with unix:");
  const std::string_view path = std::string_view(name).substr(kScheme.size());
  if (path.empty() || path == "@") return "the name is empty; must be unix:PATH or unix:@NAME";
  if (path.size() >= sizeof address.value.sun_path)
    return "the path is longer than " + std::to_string(sizeof address.value.sun_path - 1) +
           " bytes, the most that a socket can have";
  address.value.sun_family = AF_UNIX;
  std::copy(path.begin(), path.end(), address.value.sun_path);
  // An abstract name begins with a zero byte, and its length counts.
  if (path.front() == '@') address.value.sun_path[0] = '\0';
  address.size =
      static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size() + (path.front() == '@' ? 0 : 1));
  return {};
}

bool AbstractNameExists(std::string_view name) {
  std::ifstream table("/proc/net/unix");
  for (std::string line; std::getline(table, line);)
    if (line.size() > name.size() && line.ends_with(name) && line[line.size() - name.size() - 1] == ' ')
      return true;
  return false;
}

}  // namespace

OwnedDescriptor::~OwnedDescriptor() {
  if (value_ >= 0) close(value_);
}
OwnedDescriptor& OwnedDescriptor::operator=(OwnedDescriptor&& other) noexcept {
  std::swap(value_, other.value_);
  return *this;
}
int OwnedDescriptor::Release() { return std::exchange(value_, -1); }

bool IsSocketName(std::string_view name) { return name.starts_with(kScheme); }

std::optional<std::string> SocketTrouble(const std::string& name) {
  Address address;
  if (const std::string problem = Parse(name, address); !problem.empty()) return Refusal(name, problem);
  const std::string path = name.substr(kScheme.size());
  if (path.front() == '@') {
    if (AbstractNameExists(path)) return std::nullopt;
    return Refusal(name, kNobody);
  }
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) {
    if (errno == ENOENT || errno == ENOTDIR) return Refusal(name, std::string("no such socket; ") + kNobody);
    return Refusal(name, std::strerror(errno));
  }
  if (!S_ISSOCK(status.st_mode)) return Refusal(name, "the file is not a socket");
  if (access(path.c_str(), W_OK) != 0) return Refusal(name, "no permission: it belongs to another user");
  return std::nullopt;
}

OwnedDescriptor ConnectSocket(const std::string& name) {
  Address address;
  if (const std::string problem = Parse(name, address); !problem.empty())
    throw std::runtime_error(Refusal(name, problem));
  OwnedDescriptor descriptor(socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  const auto* generic = reinterpret_cast<const sockaddr*>(&address.value);
  if (descriptor.get() >= 0 && connect(descriptor.get(), generic, address.size) == 0) return descriptor;
  std::string why = std::strerror(errno);
  if (errno == ENOENT || errno == ECONNREFUSED) why = kNobody;
  if (errno == EAGAIN) why = "busy: others wait to be connected already";
  if (errno == EACCES || errno == EPERM) why = "no permission: it belongs to another user";
  if (errno == EPROTOTYPE) why = "a socket of another kind; must be a stream";
  throw std::runtime_error(Refusal(name, why));
}

}  // namespace tiltproof::link
