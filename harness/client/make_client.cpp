#include "harness/client/make_client.h"

#include <stdexcept>
#include <utility>

#include "harness/client/firmware_files.h"
#include "harness/client/library_client.h"

namespace tiltproof::harness {

std::unique_ptr<Client> MakeClient(const ClientSpec& client, const ClientSettings& settings,
                                   ClientHost host) {
  if (const auto* image = std::get_if<EmulatedImage>(&client))
    return StartEmulatorClient(BoardOf(*image, settings.firmware, *settings.protocol), settings.lines,
                               settings.start_within_ns, settings.watch, std::move(host));
  if (std::holds_alternative<HostLibrary>(client))
    return LoadLibraryClient(FirmwareFile(client, settings.firmware, settings.protocol->name),
                             settings.firmware, settings.protocol->name, std::move(host),
                             std::make_unique<CapturedOutput>());
  throw std::runtime_error(ToText(client) + ": it knows no virtual time and cannot fly in lockstep");
}

}  // namespace tiltproof::harness
