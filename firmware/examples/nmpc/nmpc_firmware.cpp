// nmpc_firmware.so: a nonlinear model predictive controller as a firmware (docs/nmpc.md). Its cycle, and what it speaks on
// the line, are those of the build `lqr`; this file puts the law into them, behind firmware/tiltproof_client.h.
#include <cstdio>
#include <new>
#include <optional>
#include <string>
#include <utility>

#include "firmware/examples/nmpc/nmpc_law.h"
#include "firmware/examples/nmpc/rotorcraft.h"
#include "firmware/lqr/lqr_application.h"
#include "firmware/ports/host/host_port.h"
#include "firmware/ports/host/lqr_parameters.h"
#include "firmware/tiltproof_client.h"

namespace {

using tiltproof::TimeNs;
using tiltproof::firmware::HostPort;
using tiltproof::firmware::LqrApplication;
using tiltproof::firmware::LqrSetup;
using tiltproof::firmware::Uart;
using tiltproof::nmpc::NmpcLaw;
using tiltproof::nmpc::Options;
using tiltproof::nmpc::Rotorcraft;

// Output during create explains its failure.
TiltproofClient* Refuse(const std::string& problem) {
  std::printf("%s\n", problem.c_str());
  std::fflush(stdout);
  return nullptr;
}

}  // namespace

struct TiltproofClient {
  TiltproofClient(const TiltproofHost& its_host, Rotorcraft its_vehicle, LqrSetup its_setup,
                  const Options& its_options)
      : port(its_host), vehicle(std::move(its_vehicle)), setup(std::move(its_setup)), options(its_options) {
    PowerOn();
  }
  void PowerOn() {
    application.reset();
    law.emplace(
        vehicle, options, setup.table.rates_in_world,
        [this](TimeNs now, TimeNs length, TimeNs deadline) { return port.Compute(now, length, deadline); });
    application.emplace(setup, *law, port);
  }

  HostPort port;
  const Rotorcraft vehicle;
  const LqrSetup setup;
  const Options options;
  std::optional<NmpcLaw> law;
  std::optional<LqrApplication> application;
};

extern "C" {

uint32_t tiltproof_client_abi_version(void) { return TILTPROOF_CLIENT_ABI_VERSION; }

TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  if (host == nullptr || host->abi_version != TILTPROOF_CLIENT_ABI_VERSION || host->transmit == nullptr)
    return nullptr;
  std::string problem;
  Options options;
  if (problem = tiltproof::nmpc::ReadOptions(host->parameters, options); !problem.empty())
    return Refuse(problem);
  std::optional<Rotorcraft> vehicle = tiltproof::nmpc::ReadRotorcraft(host->parameters, problem);
  if (!vehicle) return Refuse(problem);
  if (problem = tiltproof::nmpc::HorizonProblem(options, vehicle->period_s); !problem.empty())
    return Refuse(problem);
  LqrSetup setup;
  if (!tiltproof::firmware::ReadLqrSetup(host->parameters, setup))
    return Refuse("the protocol does not carry all states of the vehicle");
  auto* client = new (std::nothrow) TiltproofClient(*host, *std::move(vehicle), std::move(setup), options);
  if (client != nullptr && !client->law->can_fly()) {
    delete client;
    return Refuse(
        "this firmware flies vehicles with two hinges and two rotors, or four rotors and no hinges");
  }
  return client;
}

void tiltproof_client_destroy(TiltproofClient* client) { delete client; }

int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns) {
  return client->application->Start(now_ns);
}

void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t /*now_ns*/, const uint8_t* bytes,
                              size_t count) {
  if (uart != TILTPROOF_UART_MAIN && uart != TILTPROOF_UART_REFERENCE) return;
  client->application->Receive(static_cast<Uart>(uart), {bytes, count});
}

int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns) {
  return client->application->Tick(now_ns);
}

int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns) {
  client->PowerOn();
  return tiltproof_client_start(client, now_ns);
}

}  // extern "C"
