#include "harness/client/library_client.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <functional>
#include <set>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "firmware/tiltproof_client.h"
#include "harness/client/called_client.h"
#include "harness/client/firmware_guard.h"
#include "harness/process/child_process.h"
#include "harness/process/orphans.h"
#include "harness/process/own_time.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

// A loaded library. Never closed: its process ends soon, and unloading would run the firmware's exit code unguarded.
class Library {
 public:
  // Throws std::runtime_error.
  explicit Library(const std::filesystem::path& file)
      // An absolute path, or dlopen would search the system's folders for a bare name.
      : path_(std::filesystem::absolute(file).string()) {
    if (!std::filesystem::exists(path_)) throw std::runtime_error("no firmware library at " + path_);
    handle_ = LibraryCoverage::Load([&] {
      return FirmwareGuard::Call(FirmwareCall::kLoad,
                                 [&] { return dlopen(path_.c_str(), RTLD_NOW | RTLD_LOCAL); });
    });
    if (handle_ == nullptr)
      throw std::runtime_error("cannot load firmware library: " + std::string(dlerror()));

    const auto version = Symbol<decltype(&tiltproof_client_abi_version)>("tiltproof_client_abi_version");
    create = Symbol<decltype(create)>("tiltproof_client_create");
    destroy = Symbol<decltype(destroy)>("tiltproof_client_destroy");
    start = Symbol<decltype(start)>("tiltproof_client_start");
    receive = Symbol<decltype(receive)>("tiltproof_client_receive");
    grant = Symbol<decltype(grant)>("tiltproof_client_grant");
    reset = Symbol<decltype(reset)>("tiltproof_client_reset");
    FirmwareGuard::SetFirmware(reinterpret_cast<const void*>(create));
    status = reinterpret_cast<decltype(status)>(dlsym(handle_, "tiltproof_client_status"));
    role = reinterpret_cast<decltype(role)>(dlsym(handle_, "tiltproof_client_role"));
    abi_version_ = FirmwareGuard::Call(FirmwareCall::kVersion, [&] { return version(); });
    if (abi_version_ < kOldestVersion || abi_version_ > TILTPROOF_CLIENT_ABI_VERSION)
      throw std::runtime_error(
          path_ + ": built for client interface version " + std::to_string(abi_version_) +
          ", this tiltproof has versions " + std::to_string(kOldestVersion) + " to " +
          std::to_string(TILTPROOF_CLIENT_ABI_VERSION) + "; rebuild it against firmware/tiltproof_client.h");
  }

  const std::string& path() const { return path_; }
  std::uint32_t abi_version() const { return abi_version_; }

  decltype(&tiltproof_client_create) create = nullptr;
  decltype(&tiltproof_client_destroy) destroy = nullptr;
  decltype(&tiltproof_client_start) start = nullptr;
  decltype(&tiltproof_client_receive) receive = nullptr;
  decltype(&tiltproof_client_grant) grant = nullptr;
  decltype(&tiltproof_client_status) status = nullptr;  // may be missing
  decltype(&tiltproof_client_role) role = nullptr;      // may be missing
  decltype(&tiltproof_client_reset) reset = nullptr;

 private:
  template <class Function>
  Function Symbol(const char* name) {
    void* symbol = dlsym(handle_, name);
    if (symbol == nullptr)
      throw std::runtime_error(path_ + " is not a firmware library: it does not export " + name +
                               " (see firmware/tiltproof_client.h)");
    return reinterpret_cast<Function>(symbol);
  }

  // Each version so far has only added to the end of TiltproofHost.
  static constexpr std::uint32_t kOldestVersion = 1;

  std::string path_;
  void* handle_ = nullptr;
  std::uint32_t abi_version_ = 0;
};

class LibraryClient final : public CalledClient {
 public:
  LibraryClient(const std::filesystem::path& library, const std::string& firmware, std::string dialect,
                ClientHost host, std::unique_ptr<CapturedOutput> output, bool coverage,
                const std::function<std::string()>& parameters)
      : CalledClient(std::move(host)),
        output_(std::move(output)),
        library_(library),
        firmware_(firmware),
        dialect_(std::move(dialect)) {
    interface_.abi_version = library_.abi_version();
    if (parameters && library_.abi_version() >= 2) {
      parameters_ = parameters();
      interface_.parameters = parameters_.c_str();
    }
    interface_.firmware = firmware_.c_str();
    interface_.dialect = dialect_.c_str();
    interface_.context = this;
    interface_.transmit = [](void* context, int uart, std::int64_t now_ns, const std::uint8_t* bytes,
                             std::size_t count) {
      if (uart < 0 || uart > 0xFF || bytes == nullptr || count == 0) return now_ns;
      if (!FirmwareGuard::IsGuardedThread()) {
        FirmwareGuard::NoteForeignCallBack("host->transmit");
        return now_ns;
      }
      return FirmwareGuard::CallBack([&] {
        auto* client = static_cast<LibraryClient*>(context);
        const DeviceClock& clock = client->clock();
        return clock.At(client->Transmit(static_cast<Uart>(uart), clock.When(now_ns), {bytes, count}));
      });
    };
    interface_.log = [](void* context, std::int64_t now_ns, const char* text) {
      if (!FirmwareGuard::IsGuardedThread()) return FirmwareGuard::NoteForeignCallBack("host->log");
      FirmwareGuard::CallBack([&] {
        auto* client = static_cast<LibraryClient*>(context);
        return client->Log(client->clock().When(now_ns), text == nullptr ? "" : text);
      });
    };
    interface_.compute = [](void* context, std::int64_t now_ns, std::int64_t length_ns,
                            std::int64_t deadline_ns) {
      if (!FirmwareGuard::IsGuardedThread()) {
        FirmwareGuard::NoteForeignCallBack("host->compute");
        return now_ns;
      }
      return FirmwareGuard::CallBack([&] {
        auto* client = static_cast<LibraryClient*>(context);
        return client->over_ ? now_ns : client->Compute(now_ns, length_ns, deadline_ns);
      });
    };
    LibraryCoverage::Count(coverage);
    client_ = Guarded(FirmwareCall::kCreate, [&] { return library_.create(&interface_); });
    if (client_ == nullptr) {
      std::string text = library_.path() + " cannot be firmware '" + firmware_ + "' with dialect '" +
                         dialect_ + "' (tiltproof_client_create returned NULL)";
      if (output_) output_->TakeAll([&](const std::string& line) { text += ": " + line; });
      throw std::runtime_error(text);
    }
  }

  ~LibraryClient() override {
    const auto trouble = End();
    output_.reset();
    if (trouble)
      Print(stderr, "tiltproof: warning: after the flight, which counts as it was, {}\n", trouble->what());
  }

  // The flight is over and judged: the firmware's calls have no effect any more, and there is no log.
  std::optional<FirmwareTrouble> End() override {
    over_ = true;
    if (client_ == nullptr || lost_) return std::nullopt;
    try {
      FirmwareGuard::Call(FirmwareCall::kDestroy, [&] { library_.destroy(std::exchange(client_, nullptr)); });
    } catch (const FirmwareTrouble& trouble) {
      if (output_) output_->TakeAll([&](const std::string& line) { report().Look(line); });
      return Explained(trouble);
    } catch (const std::exception& error) {
      return FirmwareTrouble(false, error.what());
    }
    return std::nullopt;
  }

  Coverage CodeCoverage() override { return LibraryCoverage::Read(); }

 private:
  TimeNs StartFirmware(TimeNs shown) override {
    return Guarded(FirmwareCall::kStart, [&] { return library_.start(client_, shown); });
  }
  void ReceiveInFirmware(Uart uart, TimeNs shown, std::span<const std::uint8_t> bytes) override {
    Guarded(FirmwareCall::kReceive,
            [&] { library_.receive(client_, static_cast<int>(uart), shown, bytes.data(), bytes.size()); });
  }
  TimeNs RunFirmware(TimeNs shown) override {
    return Guarded(FirmwareCall::kGrant, [&] { return library_.grant(client_, shown); });
  }
  TimeNs ResetFirmware(TimeNs shown) override {
    return Guarded(FirmwareCall::kReset, [&] { return library_.reset(client_, shown); });
  }
  std::optional<ClientStatus> AskStatus() override {
    if (library_.status == nullptr || lost_) return std::nullopt;
    TiltproofClientStatus status{};
    Guarded(FirmwareCall::kStatus, [&] { library_.status(client_, &status); });
    return ClientStatus{status.supervisor_state, status.failsafe_count};
  }
  std::optional<std::uint32_t> AskRole() override {
    if (library_.role == nullptr || lost_) return std::nullopt;
    return Guarded(FirmwareCall::kRole, [&] { return library_.role(client_); });
  }
  // After a failure the client's state is unknown: it is not called again.
  template <class Function>
  std::invoke_result_t<const Function&> Guarded(FirmwareCall call, const Function& function) {
    try {
      return FirmwareGuard::Call(call, function);
    } catch (const FirmwareTrouble& trouble) {
      lost_ = true;
      LogAllOutput();
      throw trouble.hung ? trouble : Explained(trouble);
    } catch (...) {
      lost_ = true;
      LogAllOutput();
      throw;
    }
  }

  // Adds the place of a crash, and what was reported.
  FirmwareTrouble Explained(const FirmwareTrouble& trouble) const {
    std::string text = trouble.what();
    FirmwareEnd end = trouble.end;
    if (report().names_place())
      end.place = report().place();
    else
      text += FirmwareGuard::CrashPlace().text();
    if (!report().text().empty()) text += ": " + report().text();
    return {false, text, end};
  }

  BootTime Transmit(Uart uart, BootTime now, std::span<const std::uint8_t> bytes) {
    return over_ ? now : host().transmit(uart, now, bytes);
  }
  bool Log(BootTime now, std::string_view text) {
    if (over_) return false;
    // Earlier output comes first.
    LogOutput(now);
    host().log(now, text);
    return true;
  }

  void TakeOutput(bool all) override {
    if (!output_) return;
    const auto on_line = [this](const std::string& line) { LogLine(line); };
    if (all) {
      output_->TakeAll(on_line);
    } else {
      output_->TakeLines(on_line);
    }
  }

  std::unique_ptr<CapturedOutput> output_;
  Library library_;
  std::string firmware_, dialect_, parameters_;
  TiltproofHost interface_{};
  TiltproofClient* client_ = nullptr;
  bool lost_ = false;
  bool over_ = false;
};

}  // namespace

std::unique_ptr<Client> LoadLibraryClient(const std::filesystem::path& library, const std::string& firmware,
                                          const std::string& dialect, ClientHost host,
                                          std::unique_ptr<CapturedOutput> output, bool coverage,
                                          const std::function<std::string()>& parameters) {
  return std::make_unique<LibraryClient>(library, firmware, dialect, std::move(host), std::move(output),
                                         coverage, parameters);
}

namespace {

// The result of `say` for the library, or the reason that it is none; in a separate process. Empty when loading does not
// end, or a signal ends the wait: then the library is not tried again.
std::string TryLibrary(const std::filesystem::path& library,
                       const std::function<std::string(const Library&)>& say) {
  static std::set<std::filesystem::path> given_up;
  if (given_up.contains(library)) return {};
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0)
    throw std::runtime_error(std::string("no pipe to try a library: ") + std::strerror(errno));
  const link::OwnedDescriptor read_end(ends[0]);
  link::OwnedDescriptor write_end(ends[1]);
  std::fflush(nullptr);
  // Code that runs as the library is loaded may start processes.
  const OrphanScope orphans;
  const pid_t parent = getpid();
  const pid_t pid = fork();
  if (pid < 0) throw std::runtime_error(std::string("no process to try a library: ") + std::strerror(errno));
  if (pid == 0) {
    DieWithParent(parent);
    FirmwareGuard::Install();
    const CapturedOutput unheard;
    std::string text;
    try {
      text = say(Library(library));
    } catch (const FirmwareTrouble&) {
      // It is one. What it does wrong, its flight will show.
    } catch (const std::exception& error) {
      text = error.what();
    }
    // With a zero byte at its end: such processes keep the pipe open.
    [[maybe_unused]] const ssize_t written = write(write_end.get(), text.c_str(), text.size() + 1);
    _exit(0);
  }
  write_end = link::OwnedDescriptor();
  std::string text;
  std::array<char, 4096> buffer;
  while (!text.ends_with('\0')) {
    if (AwaitInput(read_end.get(), pid, FirmwareGuard::kUnreachableAfterNs, OnSignal::kReturn) !=
        Input::kReady) {
      given_up.insert(library);
      break;
    }
    const ssize_t got = read(read_end.get(), buffer.data(), buffer.size());
    if (got == 0) break;
    if (got > 0) text.append(buffer.data(), static_cast<std::size_t>(got));
  }
  kill(pid, SIGKILL);
  waitpid(pid, nullptr, 0);
  return text.substr(0, text.find('\0'));
}

}  // namespace

std::optional<std::string> LibraryMistake(const std::filesystem::path& library) {
  std::string mistake = TryLibrary(library, [](const Library&) { return std::string(); });
  if (mistake.empty()) return std::nullopt;
  return mistake;
}

namespace {

bool Has(const std::filesystem::path& library, bool (*has)(const Library&)) {
  const std::string yes = "yes";
  return TryLibrary(library, [&](const Library& loaded) { return has(loaded) ? yes : std::string(); }) == yes;
}

}  // namespace

bool TellsStatus(const std::filesystem::path& library) {
  return Has(library, [](const Library& loaded) { return loaded.status != nullptr; });
}

bool TellsRole(const std::filesystem::path& library) {
  return Has(library, [](const Library& loaded) { return loaded.role != nullptr; });
}

}  // namespace tiltproof::harness
