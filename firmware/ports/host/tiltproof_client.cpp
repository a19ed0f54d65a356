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
#include "firmware/lqr/timed_law.h"
#include "firmware/ports/host/host_port.h"
#include "firmware/ports/host/lqr_parameters.h"
#include "firmware/ports/host/own_numbers.h"

namespace {

using tiltproof::TimeNs;
using tiltproof::firmware::Build;
using tiltproof::firmware::FindBuild;
using tiltproof::firmware::FlightApplication;
using tiltproof::firmware::HostPort;
using tiltproof::firmware::LqrApplication;
using tiltproof::firmware::LqrSetup;
using tiltproof::firmware::OwnNumber;
using tiltproof::firmware::TimedLaw;
using tiltproof::firmware::Uart;
using tiltproof::link::Dialect;

std::optional<Dialect> FindDialect(const char* name) {
  for (const Dialect dialect : {Dialect::kPaper, Dialect::kProvant, Dialect::kHardened}) {
    if (name != nullptr && tiltproof::link::Name(dialect) == name) return dialect;
  }
  return std::nullopt;
}

}  // namespace

struct TiltproofClient {
  TiltproofClient(const TiltproofHost& host, const Build& build_in, Dialect dialect_in)
      : port(host),
        build(&build_in),
        dialect(dialect_in),
        place(tiltproof::firmware::ReadPlace(host.parameters)) {
    PowerOn();
  }
  // The build `lqr`. `compute_in`: of one step of its law; 0: computing takes no time.
  TiltproofClient(const TiltproofHost& host, LqrSetup setup_in, TimeNs compute_in)
      : port(host), setup(std::move(setup_in)), compute_ns(compute_in) {
    PowerOn();
  }
  void PowerOn() {
    if (build != nullptr) {
      application.emplace<FlightApplication>(*build, dialect, port, place);
    } else if (compute_ns == 0) {
      application.emplace<LqrApplication>(setup, port);
    } else {
      application.emplace<std::monostate>();
      law.emplace(setup.table, compute_ns, [this](TimeNs now, TimeNs length, TimeNs deadline) {
        return port.Compute(now, length, deadline);
      });
      application.emplace<LqrApplication>(setup, *law, port);
    }
  }
  // Calls `function` with the application.
  template <class Function>
  auto With(const Function& function) {
    if (auto* lqr = std::get_if<LqrApplication>(&application)) return function(*lqr);
    return function(*std::get_if<FlightApplication>(&application));
  }

  HostPort port;
  const Build* const build = nullptr;  // null: lqr
  const Dialect dialect{};
  const LqrSetup setup;
  const std::size_t place = 0;  // among the boards on the vehicle
  const TimeNs compute_ns = 0;
  std::optional<TimedLaw> law;  // where computing takes time
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
  if (build == nullptr) {
    LqrSetup setup;
    double compute_us = 0;
    const OwnNumber known[] = {{"compute_us", compute_us, 0, 1e6}};
    if (host->firmware != std::string_view("lqr") || !ReadLqrSetup(host->parameters, setup) ||
        !tiltproof::firmware::ReadOwnNumbers(host->parameters, known).empty())
      return nullptr;
    return new (std::nothrow)
        TiltproofClient(*host, std::move(setup), static_cast<TimeNs>(compute_us * tiltproof::kNsPerUs));
  }
  const std::optional<Dialect> dialect = FindDialect(host->dialect);
  if (!dialect) return nullptr;
  return new (std::nothrow) TiltproofClient(*host, *build, *dialect);
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
