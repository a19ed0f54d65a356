#include "harness/client/serial_program.h"

#include <fmt/format.h>

#include <array>

#include "harness/scenario/client_spec.h"

namespace tiltproof::harness {

std::string CommandOf(const SerialProgram& program) {
  const std::array<std::string, Program::kPlaceholders.size()> values = {program.port, program.reference_port,
                                                                         std::to_string(program.baud)};
  std::string command = program.command;
  const auto replace = [&](std::string_view name, const std::string& value) {
    const std::string place = fmt::format("{{{}}}", name);
    for (std::size_t at = 0; (at = command.find(place, at)) != std::string::npos; at += value.size())
      command.replace(at, place.size(), value);
  };
  for (std::size_t i = 0; i < values.size(); ++i) replace(Program::kPlaceholders[i], values[i]);
  for (const auto& [line, port] : program.line_ports) replace(line + "_port", port);
  return command;
}

std::vector<std::pair<std::string, std::string>> EnvironmentOf(const SerialProgram& program) {
  std::vector<std::pair<std::string, std::string>> environment = {
      {"TILTPROOF_PORT", program.port},
      {"TILTPROOF_REFERENCE_PORT", program.reference_port},
      {"TILTPROOF_BAUD", std::to_string(program.baud)},
      {"TILTPROOF_REFERENCE_BAUD", std::to_string(program.reference_baud)},
      {"TILTPROOF_FIRMWARE", program.firmware},
      {"TILTPROOF_DIALECT", program.dialect},
      {"TILTPROOF_PARAMETERS", program.parameters}};
  for (const auto& [line, port] : program.line_ports)
    environment.emplace_back("TILTPROOF_PORT_" + line, port);
  return environment;
}

}  // namespace tiltproof::harness
