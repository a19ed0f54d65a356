#include "harness/client/library_client.h"

#include <dlfcn.h>

#include <algorithm>
#include <deque>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "firmware/tiltproof_client.h"
#include "harness/client/firmware_guard.h"

namespace tiltproof::harness {
namespace {

class LibraryClient final : public Client {
 public:
  LibraryClient(const std::filesystem::path& library, const std::string& firmware, link::Dialect dialect,
                ClientHost host)
      : host_(std::move(host)), firmware_(firmware), dialect_(Name(dialect)) {
    // An absolute path, or dlopen would search the system's folders for a bare name.
    const std::string path = std::filesystem::absolute(library).string();
    if (!std::filesystem::exists(path)) throw std::runtime_error("no firmware library at " + path);
    handle_ = FirmwareGuard::Call([&] { return dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL); });
    if (handle_ == nullptr)
      throw std::runtime_error("cannot load firmware library: " + std::string(dlerror()));

    const auto version =
        Symbol<decltype(&tiltproof_client_abi_version)>(path, "tiltproof_client_abi_version");
    create_ = Symbol<decltype(create_)>(path, "tiltproof_client_create");
    destroy_ = Symbol<decltype(destroy_)>(path, "tiltproof_client_destroy");
    start_ = Symbol<decltype(start_)>(path, "tiltproof_client_start");
    receive_ = Symbol<decltype(receive_)>(path, "tiltproof_client_receive");
    grant_ = Symbol<decltype(grant_)>(path, "tiltproof_client_grant");
    reset_ = Symbol<decltype(reset_)>(path, "tiltproof_client_reset");
    status_ = reinterpret_cast<decltype(status_)>(dlsym(handle_, "tiltproof_client_status"));
    if (const auto found = FirmwareGuard::Call([&] { return version(); });
        found != TILTPROOF_CLIENT_ABI_VERSION)
      throw std::runtime_error(path + ": built for client interface version " + std::to_string(found) +
                               ", this tiltproof has version " +
                               std::to_string(TILTPROOF_CLIENT_ABI_VERSION) +
                               "; rebuild it against firmware/tiltproof_client.h");

    interface_.abi_version = TILTPROOF_CLIENT_ABI_VERSION;
    interface_.firmware = firmware_.c_str();
    interface_.dialect = dialect_.c_str();
    interface_.context = this;
    interface_.transmit = [](void* context, int uart, std::int64_t now_ns, const std::uint8_t* bytes,
                             std::size_t count) {
      const FirmwareGuard::Outside outside;
      if ((uart != TILTPROOF_UART_MAIN && uart != TILTPROOF_UART_REFERENCE) || bytes == nullptr || count == 0)
        return now_ns;
      return static_cast<LibraryClient*>(context)->host_.transmit(static_cast<Uart>(uart), now_ns,
                                                                  {bytes, count});
    };
    interface_.log = [](void* context, std::int64_t now_ns, const char* text) {
      const FirmwareGuard::Outside outside;
      static_cast<LibraryClient*>(context)->host_.log(now_ns, text == nullptr ? "" : text);
    };
    client_ = FirmwareGuard::Call([&] { return create_(&interface_); });
    if (client_ == nullptr)
      throw std::runtime_error(path + " cannot be firmware '" + firmware_ + "' with dialect '" + dialect_ +
                               "' (tiltproof_client_create returned NULL)");
  }

  ~LibraryClient() override {
    if (client_ == nullptr || lost_) return;
    try {
      FirmwareGuard::Call([&] { destroy_(client_); });
    } catch (const FirmwareTrouble&) {
      // The flight is over and scored without it; the process ends soon.
    }
  }

  TimeNs Start(TimeNs now) override {
    return Guarded([&] { return start_(client_, now); });
  }
  void Receive(Uart uart, TimeNs now, std::span<const std::uint8_t> bytes,
               std::span<const faults::ReceiveMark> /*marks*/) override {
    if (in_reset_) return;
    Guarded([&] { receive_(client_, static_cast<int>(uart), now, bytes.data(), bytes.size()); });
  }
  TimeNs Grant(TimeNs now, TimeNs /*horizon*/) override {
    // Resets that begin while it is held hold it until the last has ended.
    for (; !resets_.empty() && now >= resets_.front().begin; resets_.pop_front()) {
      in_reset_ = true;
      held_until_ = std::max(held_until_, resets_.front().end);
      host_.event({.time_ns = now,
                   .fault = resets_.front().fault,
                   .kind = kResetEvent,
                   .text = "reset, and held until it has booted"});
    }
    if (!in_reset_) {
      wake_ns_ = Guarded([&] { return grant_(client_, now); });
    } else if (now < held_until_) {
      wake_ns_ = held_until_;
    } else {
      in_reset_ = false;
      host_.event({.time_ns = now, .fault = std::nullopt, .kind = "device_runs", .text = "it has booted"});
      wake_ns_ = Guarded([&] { return reset_(client_, now); });
    }
    return resets_.empty() ? wake_ns_ : std::min(wake_ns_, resets_.front().begin);
  }
  // A library can be reset and nothing else; all other faults of a device are refused before the flight.
  void Command(const std::vector<faults::DeviceCommand>& commands, TimeNs origin) override {
    for (const faults::DeviceCommand& command : commands)
      if (command.type == "device.reset")
        resets_.push_back({origin + command.at_ns, origin + command.until_ns, command.fault});
  }
  std::optional<ClientStatus> Status() override {
    if (status_ == nullptr || lost_) return std::nullopt;
    TiltproofClientStatus status{};
    Guarded([&] { status_(client_, &status); });
    return ClientStatus{status.supervisor_state, status.failsafe_count};
  }

 private:
  template <class Function>
  Function Symbol(const std::string& path, const char* name) {
    void* symbol = dlsym(handle_, name);
    if (symbol == nullptr)
      throw std::runtime_error(path + " is no firmware library: it does not export " + name +
                               " (see firmware/tiltproof_client.h)");
    return reinterpret_cast<Function>(symbol);
  }

  // After trouble the client's state is unknown: it is not called again.
  template <class Function>
  std::invoke_result_t<const Function&> Guarded(const Function& function) {
    try {
      return FirmwareGuard::Call(function);
    } catch (const FirmwareTrouble&) {
      lost_ = true;
      throw;
    }
  }

  ClientHost host_;
  std::string firmware_, dialect_;
  // Never closed: the worker process ends soon, and unloading would run the firmware's exit code unguarded.
  void* handle_ = nullptr;
  TiltproofHost interface_{};
  TiltproofClient* client_ = nullptr;
  struct Reset {
    TimeNs begin, end;
    std::size_t fault;
  };
  std::deque<Reset> resets_;  // to come, by begin
  bool in_reset_ = false;
  TimeNs held_until_ = 0;
  TimeNs wake_ns_ = kNever;
  bool lost_ = false;
  decltype(&tiltproof_client_create) create_ = nullptr;
  decltype(&tiltproof_client_destroy) destroy_ = nullptr;
  decltype(&tiltproof_client_start) start_ = nullptr;
  decltype(&tiltproof_client_receive) receive_ = nullptr;
  decltype(&tiltproof_client_grant) grant_ = nullptr;
  decltype(&tiltproof_client_status) status_ = nullptr;
  decltype(&tiltproof_client_reset) reset_ = nullptr;
};

}  // namespace

std::unique_ptr<Client> LoadLibraryClient(const std::filesystem::path& library, const std::string& firmware,
                                          link::Dialect dialect, ClientHost host) {
  return std::make_unique<LibraryClient>(library, firmware, dialect, std::move(host));
}

}  // namespace tiltproof::harness
