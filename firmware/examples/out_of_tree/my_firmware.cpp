// A firmware that is built outside tiltproof's tree, with its installed package: frames by tiltproof::link, messages and
// the control law by tiltproof::firmware, the gain by `tiltproof design-lqr`. Yours are what stands between Receive and
// Send.

#include <array>
#include <cstdint>
#include <new>
#include <span>
#include <string_view>

#include "firmware/control_law.h"
#include "firmware/messages.h"
#include "firmware/tiltproof_client.h"
#include "link/frame.h"

namespace link = tiltproof::link;
using tiltproof::firmware::Gain;
#include "my_gain.inc"

namespace {

constexpr tiltproof::Actuators kHover = {.f_r_n = 10.2751F, .f_l_n = 10.2799F, .tau_r_nm = 0, .tau_l_nm = 0};

}  // namespace

struct TiltproofClient {
  explicit TiltproofClient(const TiltproofHost* its_host) : host(its_host) {}

  // Returns when the last bit has left.
  std::int64_t Send(std::int64_t now_ns, const link::MessageBytes& message) const {
    std::array<std::uint8_t, link::FrameBytesMax(link::kMessageBytesMax)> wire;
    const auto frame = link::EncodeFrame(message.span(), wire).bytes;
    return host->transmit(host->context, TILTPROOF_UART_MAIN, now_ns, frame.data(), frame.size());
  }

  const TiltproofHost* host;
  link::FrameDecoder main_line, reference_line;
  tiltproof::firmware::ControlLaw law{kMyGain, kHover};
  tiltproof::Sensors sensors;
  tiltproof::Reference reference;
  bool has_reply = false;
  bool has_reference = false;
  std::int64_t next_request_ns = 0;
};

std::uint32_t tiltproof_client_abi_version() { return TILTPROOF_CLIENT_ABI_VERSION; }

TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  if (host->abi_version != TILTPROOF_CLIENT_ABI_VERSION || std::string_view(host->dialect) != "paper")
    return nullptr;
  return new (std::nothrow) TiltproofClient(host);
}

void tiltproof_client_destroy(TiltproofClient* client) { delete client; }

std::int64_t tiltproof_client_start(TiltproofClient* client, std::int64_t now_ns) {
  // The first request leaves when `start` has left.
  client->next_request_ns = client->Send(now_ns, link::EncodeStart(link::Dialect::kPaper, kHover));
  return tiltproof_client_grant(client, now_ns);
}

void tiltproof_client_receive(TiltproofClient* client, int uart, std::int64_t, const std::uint8_t* bytes,
                              std::size_t count) {
  std::span received(bytes, count);
  auto& decoder = uart == TILTPROOF_UART_MAIN ? client->main_line : client->reference_line;
  while (const auto event = decoder.Next(received)) {
    if (event->status != link::FrameStatus::kOk) continue;
    if (uart != TILTPROOF_UART_MAIN)
      client->has_reference |=
          link::DecodeReference(event->payload, client->reference) == link::MessageStatus::kOk;
    else if (link::DecodeSensors(event->payload, client->sensors) == link::MessageStatus::kOk)
      client->has_reply = true;
  }
}

std::int64_t tiltproof_client_grant(TiltproofClient* client, std::int64_t now_ns) {
  if (client->has_reply) {
    client->has_reply = false;
    const auto& s = client->sensors;
    if (!client->has_reference)  // stay where the flight began
      client->reference = {.x_m = s.x_m, .y_m = s.y_m, .z_m = s.z_m, .yaw_rad = s.yaw_rad};
    client->has_reference = true;
    client->Send(now_ns,
                 link::EncodeActuators(link::Dialect::kPaper, client->law.Step(s, client->reference)));
  }
  if (now_ns >= client->next_request_ns) {
    client->next_request_ns += tiltproof::firmware::kControlPeriodNs;
    client->Send(now_ns, link::EncodeReadSensors(link::Dialect::kPaper));
  }
  return client->next_request_ns;
}

std::int64_t tiltproof_client_reset(TiltproofClient* client, std::int64_t now_ns) {
  const TiltproofHost* host = client->host;
  client->~TiltproofClient();
  new (client) TiltproofClient(host);
  return tiltproof_client_start(client, now_ns);
}
