#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "harness/cli/protocol_flag.h"
#include "harness/cli/shared_options.h"
#include "harness/integrity/integrity.h"
#include "harness/integrity/undetected.h"
#include "harness/report/files.h"
#include "harness/report/json_text.h"
#include "harness/report/report_page.h"
#include "harness/report/results.h"
#include "harness/terminal/terminal.h"
#include "link/cobs_framing.h"
#include "link/hdlc_framing.h"
#include "link/length_framing.h"
#include "link/named.h"

namespace tiltproof::harness {
namespace {

struct IntegrityOptions {
  std::vector<std::string> protocols = {"paper"}, checks, framings, errors;
  std::string message;
  std::int64_t frames_count = 1'000'000;
  std::uint64_t seed = 1;
  int jobs_count = 1;
  std::string format = "table";
  std::filesystem::path page;
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
    const std::shared_ptr<const link::Protocol> own = ReadProtocolFlag(name);
    if (!options.message.empty() && own->Find(options.message) == nullptr) {
      std::string names;
      for (const link::MessageType& type : own->messages) names += (names.empty() ? "" : ", ") + type.name;
      throw UsageError(fmt::format("--message {}: protocol '{}' has: {}", options.message, name, names));
    }
    if (DefaultMessage(*own) == nullptr && options.message.empty())
      throw UsageError(fmt::format(
          "--protocol {}: its server sends no message on the main line; choose one of its client's with "
          "--message",
          name));
    if (options.framings.empty() && options.checks.empty()) {
      protocols.push_back(own);
      continue;
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

// One format that is measured.
struct Format {
  std::shared_ptr<const link::Protocol> protocol;
  const link::MessageType* message;
  link::CheckKind check;
  int hamming_distance;  // of payload and check; 0: it is larger than those that are counted
};

Format FormatOf(std::shared_ptr<const link::Protocol> protocol, const std::string& message) {
  const link::MessageType* type = message.empty() ? DefaultMessage(*protocol) : protocol->Find(message);
  const link::CheckKind check = protocol->framing->check().value();
  const UndetectedErrors errors(check, type->payload_bytes + link::CheckBytes(check));
  return {std::move(protocol), type, check, errors.HammingDistance()};
}

nlohmann::ordered_json ToJson(const Format& format, ErrorKind errors, const IntegrityRow& row) {
  nlohmann::ordered_json json = {{"protocol", format.protocol->name},
                                 {"framing", format.protocol->framing->name()},
                                 {"check", Name(format.check)},
                                 {"message", format.message->name},
                                 {"errors", Name(errors)},
                                 {"level", row.level},
                                 {"frames", row.frames_count},
                                 {"delivered_wrong", row.delivered_wrong_count},
                                 {"rate", row.delivered_wrong.rate},
                                 {"low", row.delivered_wrong.low},
                                 {"high", row.delivered_wrong.high}};
  const auto add = [&](const std::string& name, std::int64_t count, const Rate& rate) {
    json[name] = count;
    json[name + "_rate"] = rate.rate;
    json[name + "_low"] = rate.low;
    json[name + "_high"] = rate.high;
  };
  add("passed_check", row.passed_check_count, row.passed_check);
  add("passed_length", row.passed_length_count, row.passed_length);
  json["theory"] = row.theory ? nlohmann::ordered_json(*row.theory) : nlohmann::ordered_json(nullptr);
  json["hamming_distance"] = format.hamming_distance == 0 ? nlohmann::ordered_json(nullptr)
                                                          : nlohmann::ordered_json(format.hamming_distance);
  return json;
}

void PrintTable(const Format& format, ErrorKind errors, const std::vector<IntegrityRow>& rows) {
  Print(stdout, "{}, {}, {}, {}: wrong frames delivered per frame sent\n", format.protocol->name,
        format.protocol->framing->name(), Name(format.check), format.message->name);
  Print(stdout, "{:>9} {:>11} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}\n", Name(errors), "frames", "theory",
        "check", "length", "accepted", "at least", "at most");
  for (const IntegrityRow& row : rows)
    Print(stdout, "{:>9g} {:>11} {:>8} {:>8.2g} {:>8.2g} {:>8.2g} {:>8.2g} {:>8.2g}\n", row.level,
          row.frames_count, row.theory ? fmt::format("{:.2g}", *row.theory) : "-", row.passed_check.rate,
          row.passed_length.rate, row.delivered_wrong.rate, row.delivered_wrong.low,
          row.delivered_wrong.high);
}

void WritePage(const std::filesystem::path& file, const nlohmann::ordered_json& rows) {
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path());
  const nlohmann::ordered_json json = {{"version", Version()}, {"rows", rows}};
  WriteFile(file, PageWith(IntegrityPageTemplate(), "<script type=\"application/json\" id=\"integrity\">" +
                                                        ScriptSafe(JsonText(json)) + "</script>\n"));
}

int IntegrityCommand(const IntegrityOptions& options) {
  std::vector<ErrorKind> errors;
  for (const std::string& name : options.errors) errors.push_back(NamedBy<ErrorKind>("--errors", name));
  if (errors.empty()) errors = {ErrorKind::kBer};
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const auto& protocol : ProtocolsOf(options)) {
    const Format format = FormatOf(protocol, options.message);
    for (const ErrorKind kind : errors) {
      const std::vector<IntegrityRow> measured = MeasureIntegrity({.protocol = protocol,
                                                                   .message = format.message->name,
                                                                   .errors = kind,
                                                                   .frames_count = options.frames_count,
                                                                   .seed = options.seed,
                                                                   .threads_count = options.jobs_count});
      for (const IntegrityRow& row : measured) rows.push_back(ToJson(format, kind, row));
      if (options.format == "table") PrintTable(format, kind, measured);
    }
  }
  if (options.format == "json")
    Print(stdout, "{}\n", TextLines(nlohmann::ordered_json{{"rows", rows}}.dump(2)));
  if (!options.page.empty()) WritePage(options.page, rows);
  return kExitGreen;
}

}  // namespace

void RegisterIntegrity(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<IntegrityOptions>();
  CLI::App* command = program.add_subcommand(
      "integrity", "Measure how often damaged frames of a protocol are delivered as wrong ones");
  command
      ->add_option("--protocol", options->protocols, "Protocols: paper, provant, hardened, or protocol files")
      ->delimiter(',');
  command
      ->add_option("--framing", options->framings,
                   fmt::format("Framings in place of the protocol's: {}", kFramings))
      ->delimiter(',');
  command
      ->add_option("--check", options->checks,
                   fmt::format("Checks in place of the protocol's: {}", AllNames<link::CheckKind>()))
      ->delimiter(',');
  command->add_option("--message", options->message,
                      "The message whose frames are damaged (default: the reply of the server)");
  command
      ->add_option("--errors", options->errors,
                   fmt::format("Kinds of damage (default: ber): {}", AllNames<ErrorKind>()))
      ->delimiter(',');
  command
      ->add_option("--frames", options->frames_count,
                   "Damaged frames for each level; loss and insert: a tenth of them")
      ->check(CLI::Range(std::int64_t{1000}, std::int64_t{1'000'000'000'000}))
      ->capture_default_str();
  command->add_option("--seed", options->seed, "Seed of what is drawn")
      ->check(CLI::Range(std::uint64_t{0}, kSeedMax))
      ->capture_default_str();
  AddJobs(*command, options->jobs_count);
  command->add_option("--format", options->format, "table or json")
      ->check(CLI::IsMember({"table", "json"}))
      ->capture_default_str();
  command->add_option("--page", options->page, "Writes a page with curves to this file (HTML)");
  command->footer(
      "`check`: the framing and its check deliver the frame. `length`: it has the id and the exact length of "
      "a "
      "message, too. `accepted`: its values are in their ranges, too; this rate has the bounds between which "
      "it "
      "lies with 95 % confidence. `theory`: the rate of `check` by theory, without framing.");
  SetAction(*command, line, [options] { return IntegrityCommand(*options); });
}

}  // namespace tiltproof::harness
