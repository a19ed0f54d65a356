#include "harness/client/make_client.h"

#include <utility>

#include "harness/client/library_client.h"

namespace tiltproof::harness {

std::unique_ptr<Client> MakeClient(const ClientSource& source, const ClientSettings& settings,
                                   ClientHost host) {
  if (source.emulator)
    return StartEmulatorClient(*source.emulator, settings.lines, settings.start_within_ns, std::move(host));
  return LoadLibraryClient(source.library, settings.firmware, settings.dialect, std::move(host),
                           std::make_unique<CapturedOutput>());
}

}  // namespace tiltproof::harness
