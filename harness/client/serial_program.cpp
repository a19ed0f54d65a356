#include "harness/client/serial_program.h"

#include <fmt/format.h>

#include <array>

#include "harness/scenario/client_spec.h"

namespace tiltproof::harness {

std::string CommandOf(const SerialProgram& program) {
  const std::array<std::string, Program::kPlaceholders.size()> values = {program.port, program.reference_port,
                                                                         std::to_string(program.baud)};
  std::string command = program.command;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::string place = fmt::format("{{{}}}", Program::kPlaceholders[i]);
    for (std::size_t at = 0; (at = command.find(place, at)) != std::string::npos; at += values[i].size())
      command.replace(at, place.size(), values[i]);
  }
  return command;
}

std::vector<std::pair<std::string, std::string>> EnvironmentOf(const SerialProgram& program) {
  return {{"TILTPROOF_PORT", program.port},
          {"TILTPROOF_REFERENCE_PORT", program.reference_port},
          {"TILTPROOF_BAUD", std::to_string(program.baud)},
          {"TILTPROOF_REFERENCE_BAUD", std::to_string(program.reference_baud)},
          {"TILTPROOF_FIRMWARE", program.firmware},
          {"TILTPROOF_DIALECT", program.dialect},
          {"TILTPROOF_PARAMETERS", program.parameters}};
}

}  // namespace tiltproof::harness
