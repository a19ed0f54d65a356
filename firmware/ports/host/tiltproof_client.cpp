// The flight firmware on the host: the C interface of firmware/tiltproof_client.h over FlightApplication, or over
// LqrApplication for the build `lqr`.
//
// One TiltproofClient is one board with all its state; memory is allocated in tiltproof_client_create and
// nowhere else, except by the build `lqr`, which has no image.
#include "firmware/tiltproof_client.h"

#include <new>
#include <optional>
#include <string_view>
#include <utility>
#include <variant>

#include "firmware/flight_application.h"
#include "firmware/lqr/lqr_application.h"
#include "firmware/ports/host/lqr_parameters.h"

namespace {

using tiltproof::TimeNs;
using tiltproof::firmware::Build;
using tiltproof::firmware::FindBuild;
using tiltproof::firmware::FlightApplication;
using tiltproof::firmware::LqrApplication;
using tiltproof::firmware::LqrSetup;
using tiltproof::firmware::Uart;
using tiltproof::link::Dialect;

class HostPort final : public tiltproof::firmware::Port {
 public:
  explicit HostPort(const TiltproofHost& host) : host_(host) {}

  TimeNs Transmit(Uart uart, TimeNs now, std::span<const std::uint8_t> bytes) override {
    return host_.transmit(host_.context, static_cast<int>(uart), now, bytes.data(), bytes.size());
  }
  void Log(TimeNs now, const char* text) override {
    if (host_.log != nullptr) host_.log(host_.context, now, text);
  }

 private:
  const TiltproofHost host_;
};

std::optional<Dialect> FindDialect(const char* name) {
  for (const Dialect dialect : {Dialect::kPaper, Dialect::kProvant, Dialect::kHardened}) {
    if (name != nullptr && tiltproof::link::Name(dialect) == name) return dialect;
  }
  return std::nullopt;
}

}  // namespace

struct TiltproofClient {
  // `build`: null for the build `lqr`, whose numbers and protocol are then in `setup`.
  TiltproofClient(const TiltproofHost& host, const Build* build_in, LqrSetup setup_in, Dialect dialect_in)
      : port(host),
        build(build_in),
        setup(std::move(setup_in)),
        dialect(dialect_in),
        place(build_in == nullptr ? 0 : tiltproof::firmware::ReadPlace(host.parameters)) {
    PowerOn();
  }
  void PowerOn() {
    if (build != nullptr)
      application.emplace<FlightApplication>(*build, dialect, port, place);
    else
      application.emplace<LqrApplication>(setup, port);
  }
  // Calls `function` with the application.
  template <class Function>
  auto With(const Function& function) {
    if (auto* lqr = std::get_if<LqrApplication>(&application)) return function(*lqr);
    return function(*std::get_if<FlightApplication>(&application));
  }

  HostPort port;
  const Build* const build;
  const LqrSetup setup;
  const Dialect dialect;
  const std::size_t place;  // among the boards on the vehicle
  // One of the two; a reset makes it again in place.
  std::variant<std::monostate, FlightApplication, LqrApplication> application;
};

extern "C" {

uint32_t tiltproof_client_abi_version(void) { return TILTPROOF_CLIENT_ABI_VERSION; }

TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  if (host == nullptr || host->abi_version != TILTPROOF_CLIENT_ABI_VERSION || host->transmit == nullptr ||
      host->firmware == nullptr) {
    return nullptr;
  }
  const Build* build = FindBuild(host->firmware);
  LqrSetup setup;
  if (build == nullptr) {
    if (host->firmware != std::string_view("lqr") || !ReadLqrSetup(host->parameters, setup)) return nullptr;
    return new (std::nothrow) TiltproofClient(*host, nullptr, std::move(setup), {});
  }
  const std::optional<Dialect> dialect = FindDialect(host->dialect);
  if (!dialect) return nullptr;
  return new (std::nothrow) TiltproofClient(*host, build, {}, *dialect);
}

void tiltproof_client_destroy(TiltproofClient* client) { delete client; }

int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns) {
  return client->With([&](auto& application) { return application.Start(now_ns); });
}

void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t /*now_ns*/, const uint8_t* bytes,
                              size_t count) {
  if (uart < TILTPROOF_UART_MAIN || uart > static_cast<int>(Uart::kSecondCross)) return;
  client->With([&](auto& application) { application.Receive(static_cast<Uart>(uart), {bytes, count}); });
}

int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns) {
  return client->With([&](auto& application) { return application.Tick(now_ns); });
}

void tiltproof_client_status(const TiltproofClient* client, TiltproofClientStatus* status) {
  // The build `lqr` has no supervisor.
  const auto* application = std::get_if<FlightApplication>(&client->application);
  const tiltproof::firmware::Status own =
      application == nullptr ? tiltproof::firmware::Status{} : application->status();
  *status = {.supervisor_state = static_cast<uint32_t>(own.state), .failsafe_count = own.failsafe_count};
}

uint32_t tiltproof_client_role(const TiltproofClient* client) {
  const auto* application = std::get_if<FlightApplication>(&client->application);
  return application == nullptr ? TILTPROOF_ROLE_ACTIVE : static_cast<uint32_t>(application->role());
}

int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns) {
  client->PowerOn();
  return tiltproof_client_start(client, now_ns);
}

}  // extern "C"
