#include "harness/client/make_client.h"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "harness/client/clocked_program.h"
#include "harness/client/firmware_files.h"
#include "harness/client/library_client.h"
#include "harness/client/program_client.h"
#include "harness/client/serial_program.h"
#include "harness/scenario/protocol_file.h"

namespace tiltproof::harness {

namespace {

std::vector<link::LineRate> UartsOf(const EmulatorLines& lines) {
  std::vector<link::LineRate> uarts = {lines.main, lines.reference};
  for (const auto& [id, rate] : lines.between) uarts.push_back(rate);
  return uarts;
}

ProgramSpec SpecOf(const LockstepProgram& program, const ClientSettings& settings) {
  ProgramSpec spec = {.name = ToText(program), .command = program.command};
  spec.uart_count = static_cast<int>(UartsOf(settings.lines).size());
  if (!program.clocked) return spec;
  const SerialProgram serial = {.command = program.command,
                                .port = kClockedPort,
                                .reference_port = kClockedReferencePort,
                                .baud = settings.lines.main.OrUsual().baud,
                                .reference_baud = settings.lines.reference.OrUsual().baud,
                                .firmware = settings.firmware,
                                .dialect = DialectOf(*settings.protocol),
                                .parameters = settings.parameters ? settings.parameters() : "{}"};
  spec.command = Executed(CommandOf(serial));
  spec.environment = EnvironmentOf(serial);
  spec.environment.emplace_back("LD_PRELOAD", ClockLibrary().string());
  spec.clocked = true;
  return spec;
}

}  // namespace

std::unique_ptr<Client> MakeClient(const ClientSpec& client, const ClientSettings& settings,
                                   ClientHost host) {
  if (const auto* image = std::get_if<EmulatedImage>(&client)) {
    std::vector<std::string> lines;
    for (const auto& [id, rate] : settings.lines.between) lines.push_back(id);
    EmulatorSpec board = BoardOf(*image, settings.firmware, *settings.protocol, settings.place, lines);
    if (settings.debug) board.gdb_port = settings.debug->port;
    board.halted = settings.debug && !settings.debug->at_ns;
    board.coverage = settings.coverage;
    return StartEmulatorClient(board, settings.lines, settings.start_within_ns, settings.watch,
                               settings.debug ? settings.debug->at_ns : std::nullopt, std::move(host));
  }
  // The shipped firmware prints nothing: looking for that in every period would be in vain.
  if (const auto* library = std::get_if<HostLibrary>(&client)) {
    auto loaded = LoadLibraryClient(
        FirmwareFile(client, settings.firmware, DialectOf(*settings.protocol)), settings.firmware,
        DialectOf(*settings.protocol), std::move(host),
        library->file.empty() ? nullptr : std::make_unique<CapturedOutput>(), settings.coverage,
        TakesParameters(*library, settings.firmware) ? settings.parameters : nullptr);
    return settings.debug ? WaitForDebugger(std::move(loaded), *settings.debug) : std::move(loaded);
  }
  if (const auto* program = std::get_if<LockstepProgram>(&client))
    return StartProgramClient(SpecOf(*program, settings),
                              {.uarts = UartsOf(settings.lines),
                               .firmware = settings.firmware,
                               .dialect = DialectOf(*settings.protocol),
                               .parameters = settings.parameters ? settings.parameters() : "{}"},
                              std::move(host));
  throw std::runtime_error(ToText(client) + ": it knows no virtual time and cannot fly in lockstep");
}

}  // namespace tiltproof::harness
