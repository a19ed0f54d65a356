#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "harness/cli/shared_options.h"
#include "harness/integrity/integrity.h"
#include "harness/terminal/terminal.h"
#include "link/cobs_framing.h"
#include "link/hdlc_framing.h"
#include "link/length_framing.h"
#include "link/named.h"

namespace tiltproof::harness {
namespace {

struct IntegrityOptions {
  std::vector<std::string> protocols = {"paper"}, checks, framings, errors;
  std::string message = "sensors";
  std::int64_t frames_count = 1'000'000;
  std::uint64_t seed = 1;
  int jobs_count = 1;
  std::string format = "table";
};

constexpr std::string_view kFramings = "hdlc, cobs, length_prefixed";

template <class Enum>
std::string AllNames() {
  std::string names;
  for (int i = 0; i <= static_cast<int>(LastOf(Enum())); ++i)
    names += (i == 0 ? "" : ", ") + std::string(Name(static_cast<Enum>(i)));
  return names;
}

template <class Enum>
Enum NamedBy(std::string_view flag, const std::string& name) {
  if (const auto found = FindNamed<Enum>(name)) return *found;
  throw UsageError(fmt::format("{} {}: unknown; valid: {}", flag, name, AllNames<Enum>()));
}

std::shared_ptr<const link::Framing> FramingOf(const std::string& name, link::CheckKind check) {
  if (name == "hdlc") return link::MakeHdlcFraming(check);
  if (name == "cobs") return link::MakeCobsFraming(check);
  if (name == "length_prefixed") return link::MakeLengthFraming({.sync = {0xAA, 0x55}}, check);
  throw UsageError(fmt::format("--framing {}: unknown; valid: {}", name, kFramings));
}

// Each protocol with each framing and check that were asked for, or with its own.
std::vector<std::shared_ptr<const link::Protocol>> ProtocolsOf(const IntegrityOptions& options) {
  std::vector<std::shared_ptr<const link::Protocol>> protocols;
  for (const std::string& name : options.protocols) {
    const auto own = link::FindProtocol(name);
    if (!own) throw UsageError(fmt::format("--protocol {}: unknown; valid: paper, provant", name));
    if (own->Find(options.message) == nullptr) {
      std::string names;
      for (const link::MessageType& type : own->messages) names += (names.empty() ? "" : ", ") + type.name;
      throw UsageError(fmt::format("--message {}: protocol '{}' has: {}", options.message, name, names));
    }
    std::vector<std::string> framings = options.framings, checks = options.checks;
    if (framings.empty()) framings = {std::string(own->framing->name())};
    if (checks.empty()) checks = {std::string(Name(own->framing->check().value()))};
    for (const std::string& framing : framings) {
      for (const std::string& check : checks) {
        const auto protocol = std::make_shared<link::Protocol>(*own);
        protocol->framing = FramingOf(framing, NamedBy<link::CheckKind>("--check", check));
        protocols.push_back(protocol);
      }
    }
  }
  return protocols;
}

nlohmann::ordered_json ToJson(const link::Protocol& protocol, const IntegritySpec& spec,
                              const IntegrityRow& row) {
  nlohmann::ordered_json json = {{"protocol", protocol.name},
                                 {"framing", protocol.framing->name()},
                                 {"check", Name(protocol.framing->check().value())},
                                 {"message", spec.message},
                                 {"errors", Name(spec.errors)},
                                 {"level", row.level},
                                 {"frames", row.frames_count},
                                 {"delivered_wrong", row.delivered_wrong_count},
                                 {"rate", row.delivered_wrong.rate},
                                 {"low", row.delivered_wrong.low},
                                 {"high", row.delivered_wrong.high},
                                 {"passed_check", row.passed_check_count},
                                 {"passed_check_rate", row.passed_check.rate},
                                 {"passed_check_low", row.passed_check.low},
                                 {"passed_check_high", row.passed_check.high}};
  json["theory"] = row.theory ? nlohmann::ordered_json(*row.theory) : nlohmann::ordered_json(nullptr);
  return json;
}

std::string TextOf(const Rate& rate) {
  return fmt::format("{:8.2g} {:>8.2g} {:>8.2g}", rate.rate, rate.low, rate.high);
}

int IntegrityCommand(const IntegrityOptions& options) {
  std::vector<ErrorKind> errors;
  for (const std::string& name : options.errors) errors.push_back(NamedBy<ErrorKind>("--errors", name));
  if (errors.empty()) errors = {ErrorKind::kBer};
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const auto& protocol : ProtocolsOf(options)) {
    for (const ErrorKind kind : errors) {
      const IntegritySpec spec{.protocol = protocol,
                               .message = options.message,
                               .errors = kind,
                               .frames_count = options.frames_count,
                               .seed = options.seed,
                               .threads_count = options.jobs_count};
      const std::vector<IntegrityRow> measured = MeasureIntegrity(spec);
      if (options.format == "json") {
        for (const IntegrityRow& row : measured) rows.push_back(ToJson(*protocol, spec, row));
        continue;
      }
      Print(stdout, "{}, {}, {}, {}: wrong frames delivered per frame sent\n", protocol->name,
            protocol->framing->name(), Name(protocol->framing->check().value()), options.message);
      Print(stdout, "{:>10} {:>11} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}\n", Name(kind), "frames",
            "passed", "at least", "at most", "accepted", "at least", "at most", "theory");
      for (const IntegrityRow& row : measured)
        Print(stdout, "{:>10g} {:>11} {} {} {:>8}\n", row.level, row.frames_count, TextOf(row.passed_check),
              TextOf(row.delivered_wrong), row.theory ? fmt::format("{:.2g}", *row.theory) : "-");
    }
  }
  if (options.format == "json")
    Print(stdout, "{}\n", TextLines(nlohmann::ordered_json{{"rows", rows}}.dump(2)));
  return kExitGreen;
}

}  // namespace

void RegisterIntegrity(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<IntegrityOptions>();
  CLI::App* command = program.add_subcommand(
      "integrity", "Measure how often damaged frames of a protocol are delivered as wrong ones");
  command->add_option("--protocol", options->protocols, "Protocols: paper, provant")->delimiter(',');
  command
      ->add_option("--framing", options->framings,
                   fmt::format("Framings in place of the protocol's: {}", kFramings))
      ->delimiter(',');
  command
      ->add_option("--check", options->checks,
                   fmt::format("Checks in place of the protocol's: {}", AllNames<link::CheckKind>()))
      ->delimiter(',');
  command->add_option("--message", options->message, "The message whose frames are damaged")
      ->capture_default_str();
  command
      ->add_option("--errors", options->errors,
                   fmt::format("Kinds of damage (default: ber): {}", AllNames<ErrorKind>()))
      ->delimiter(',');
  command->add_option("--frames", options->frames_count, "Damaged frames for each level")
      ->check(CLI::Range(std::int64_t{1000}, std::int64_t{1'000'000'000'000}))
      ->capture_default_str();
  command->add_option("--seed", options->seed, "Seed of what is drawn")
      ->check(CLI::Range(std::uint64_t{0}, kSeedMax))
      ->capture_default_str();
  AddJobs(*command, options->jobs_count);
  command->add_option("--format", options->format, "table or json")
      ->check(CLI::IsMember({"table", "json"}))
      ->capture_default_str();
  command->footer(
      "`passed`: the framing and its check deliver the frame. `accepted`: its length, its id and the ranges "
      "of its "
      "values are those of a message, too. Each rate has the bounds between which it lies with 95 % "
      "confidence. "
      "`theory`: a check that detects all but 2^-bits of the damage.");
  SetAction(*command, line, [options] { return IntegrityCommand(*options); });
}

}  // namespace tiltproof::harness
