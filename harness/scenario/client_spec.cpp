#include "harness/scenario/client_spec.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <vector>

#include "faults/nearest_name.h"

namespace tiltproof::harness {
namespace {

constexpr std::array<ClientForm, 7> kForms = {{
    {"host", "the shipped firmware, built for this machine (the default)"},
    {"library:FILE", "a firmware built as a shared library (firmware/tiltproof_client.h)"},
    {"qemu[:ELF]",
     "an image for the STM32F4 on an emulated board; without one, or as qemu:executive or qemu:freertos, the "
     "shipped one. After an image: ,main=usartN ,reference=usartN ,console=usartN (2, 3 and 1), ,"
     "LINE=usartN for each line to another board, ,hse=HZ (the board's crystal, 8000000)"},
    {"program:CMD", "a program in any language that flies in lockstep over a socket (docs/program.md)"},
    {"clocked:CMD",
     "a program with serial ports, {port}, {reference_port} and {baud} in CMD, unmodified under a virtual "
     "clock: it flies in "
     "lockstep (docs/program.md)"},
    {"process:CMD",
     "a program with serial ports, {port}, {reference_port} and {baud} in CMD; --mode realtime"},
    {"serial:DEV[,REFDEV][,LINE=DEV][,reset=HOW]",
     "a board on serial devices, or on sockets (unix:PATH): main line, reference line, each line to another "
     "board; --mode realtime. HOW "
     "resets "
     "the board before each flight: dtr, rts (lines of DEV), or a command, up to the end"},
}};

// In the order of ClientSpec.
constexpr std::array<std::string_view, std::variant_size_v<ClientSpec>> kKinds = {
    "library", "qemu", "process", "serial", "program"};

std::string Absolute(std::string_view file) { return std::filesystem::absolute(file).string(); }

struct Usart {
  std::string_view line;
  int EmulatedImage::*number;
};
constexpr std::array<Usart, 3> kUsarts = {{{"main", &EmulatedImage::main_usart},
                                           {"reference", &EmulatedImage::reference_usart},
                                           {"console", &EmulatedImage::console_usart}}};

// From outside; a crystal has 4 to 26 MHz (datasheet DS8626).
constexpr int kHseHzMin = 1'000'000, kHseHzMax = 50'000'000;

bool IsLineId(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
    return c == '_' || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  });
}

void ReadOption(std::string_view option, EmulatedImage& image) {
  constexpr std::string_view kHse = "hse=";
  if (option.starts_with(kHse)) {
    const std::string_view value = option.substr(kHse.size());
    const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), image.hse_hz);
    const bool is_number = error == std::errc() && end == value.data() + value.size();
    if (is_number && (image.hse_hz == 0 || (image.hse_hz >= kHseHzMin && image.hse_hz <= kHseHzMax))) return;
    const bool is_in_mhz = is_number && image.hse_hz > 0 && image.hse_hz <= kHseHzMax / kHseHzMin;
    throw ClientMistake(fmt::format(
        "'{}' is not hse=HZ: in Hz, from {} to {}, or 0 (no crystal){}", option, kHseHzMin, kHseHzMax,
        is_in_mhz ? fmt::format("; {} MHz are hse={}", image.hse_hz, image.hse_hz * kHseHzMin) : ""));
  }
  const std::size_t equals = option.find('=');
  const std::string_view usart = equals == option.npos ? "" : option.substr(equals + 1);
  const bool valid = usart.size() == 6 && usart.starts_with("usart") && usart[5] >= '1' && usart[5] <= '6';
  for (const auto& [line, number] : kUsarts) {
    if (line != option.substr(0, equals) || !valid) continue;
    image.*number = usart[5] - '0';
    return;
  }
  const std::string line(option.substr(0, equals));
  if (valid && IsLineId(line)) {
    if (!image.line_usarts.try_emplace(line, usart[5] - '0').second)
      throw ClientMistake(fmt::format("the line '{}' has a USART already", line));
    return;
  }
  throw ClientMistake(
      fmt::format("'{}' is none of main=usartN, reference=usartN, console=usartN with N from 1 to 6, "
                  "LINE=usartN for a line "
                  "to another board, or hse=HZ (a path with a comma cannot be given)",
                  option));
}

// Reads the text after "qemu:".
EmulatedImage ReadImage(std::string_view rest) {
  const auto next = [&rest] {
    const std::string_view part = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(rest.size(), part.size() + 1));
    return part;
  };
  EmulatedImage image;
  const std::string_view what = next();
  if (what.empty())
    throw ClientMistake("names no image; use qemu, qemu:executive, qemu:freertos or qemu:FILE.elf");
  if (what == "executive" || what == "freertos") {
    image.scheduler = what;
  } else {
    image.file = Absolute(what);
  }
  while (!rest.empty()) ReadOption(next(), image);
  if (image.main_usart == image.reference_usart || image.main_usart == image.console_usart ||
      image.reference_usart == image.console_usart)
    throw ClientMistake(
        fmt::format("main line, reference line and console need a USART each; they are on {}, {} and {}",
                    image.main_usart, image.reference_usart, image.console_usart));
  std::map<int, std::string_view> taken;
  for (const auto& [line, number] : kUsarts) taken.emplace(image.*number, line);
  for (const auto& [line, number] : image.line_usarts)
    if (const auto [other, is_new] = taken.try_emplace(number, line); !is_new)
      throw ClientMistake(
          fmt::format("{} and {} need a USART each; both are on {}", other->second, line, number));
  return image;
}

// Braces are the shell's, and its programs', too: only what is nearly a placeholder is a mistake.
Program ReadProgram(const std::string& command) {
  for (std::size_t open = command.find('{'); open != command.npos; open = command.find('{', open + 1)) {
    const std::size_t close = command.find('}', open);
    if (close == command.npos) break;
    if (open > 0 && command[open - 1] == '$') continue;
    const std::string name = command.substr(open + 1, close - open - 1);
    const auto is_letter = [](char c) {
      return c == '_' || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    };
    if (name.empty() || !std::all_of(name.begin(), name.end(), is_letter)) continue;
    const auto& known = Program::kPlaceholders;
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    std::string lower = name;
    for (char& c : lower) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
    if (const std::string_view meant = faults::NearestName(lower, known); !meant.empty())
      throw ClientMistake(fmt::format("unknown placeholder {{{}}}, did you mean {{{}}}? There are {{{}}}",
                                      name, meant, fmt::join(known, "}, {")));
  }
  return {command};
}

SerialBoard ReadBoard(const std::string& text) {
  constexpr std::string_view kReset = ",reset=";
  const std::size_t reset = text.find(kReset);
  std::string devices = text.substr(0, reset);
  SerialBoard board;
  // Behind the other devices. A path has a slash before any equals sign.
  for (std::size_t comma = devices.rfind(','); comma != devices.npos; comma = devices.rfind(',')) {
    const std::size_t equals = devices.find('=', comma);
    if (equals == devices.npos || !IsLineId(std::string_view(devices).substr(comma + 1, equals - comma - 1)))
      break;
    const std::string line = devices.substr(comma + 1, equals - comma - 1);
    const std::string device = devices.substr(equals + 1);
    if (device.empty())
      throw ClientMistake(fmt::format("{}= needs a device, as {}=/dev/ttyUSB2", line, line));
    if (!board.line_devices.emplace(line, device).second)
      throw ClientMistake(fmt::format("the line '{}' has a device already", line));
    devices.resize(comma);
  }
  const std::size_t comma = devices.find(',');
  if (reset != std::string::npos) board.reset = text.substr(reset + kReset.size());
  if (reset != std::string::npos && board.reset.empty())
    throw ClientMistake("reset= needs dtr, rts or a command, for example reset=st-flash reset");
  board.device = devices.substr(0, comma);
  if (comma != std::string::npos) board.reference_device = devices.substr(comma + 1);
  if (board.device.empty() || (comma != std::string::npos && board.reference_device.empty()) ||
      board.reference_device.find(',') != std::string::npos)
    throw ClientMistake(
        "must be serial:DEVICE or serial:DEVICE,DEVICE, then perhaps ,LINE=DEVICE for each line to another "
        "board, and ,reset=dtr, ,reset=rts or ,reset=COMMAND");
  return board;
}

[[noreturn]] void ThrowUnknownKind(std::string_view kind) {
  std::vector<std::string_view> kinds, forms;
  for (const ClientForm& form : kForms) {
    kinds.push_back(form.form.substr(0, form.form.find_first_of("[:")));
    forms.push_back(form.form);
  }
  const std::string_view meant = faults::NearestName(kind, kinds);
  throw ClientMistake(fmt::format(
      "unknown kind '{}'{} {}", kind,
      meant.empty() ? "; use" : fmt::format(", did you mean {}? There are", meant), fmt::join(forms, ", ")));
}

std::string TextOf(const HostLibrary& library) {
  return library.file.empty() ? "host" : "library:" + library.file;
}
std::string TextOf(const EmulatedImage& image) {
  std::string text = "qemu:" + (image.file.empty() ? image.scheduler : image.file);
  for (const auto& [line, number] : kUsarts)
    if (image.*number != EmulatedImage{}.*number) text += fmt::format(",{}=usart{}", line, image.*number);
  for (const auto& [line, number] : image.line_usarts) text += fmt::format(",{}=usart{}", line, number);
  if (image.hse_hz != EmulatedImage{}.hse_hz) text += fmt::format(",hse={}", image.hse_hz);
  return text == "qemu:executive" ? "qemu" : text;
}
std::string TextOf(const Program& program) { return "process:" + program.command; }
std::string TextOf(const LockstepProgram& program) {
  return (program.clocked ? "clocked:" : "program:") + program.command;
}
std::string TextOf(const SerialBoard& board) {
  std::string text =
      "serial:" + board.device + (board.reference_device.empty() ? "" : ",") + board.reference_device;
  for (const auto& [line, device] : board.line_devices) text += fmt::format(",{}={}", line, device);
  return text + (board.reset.empty() ? "" : ",reset=") + board.reset;
}

void Add(const HostLibrary& library, ClientAbilities& abilities) {
  abilities.virtual_time = abilities.guarded = true;
  abilities.shipped = library.file.empty();
  abilities.clock = true;
  abilities.reset = abilities.task = abilities.computing = !abilities.realtime;
}
void Add(const EmulatedImage& image, ClientAbilities& abilities) {
  abilities.virtual_time = true;
  abilities.shipped = image.file.empty();
  abilities.reset = abilities.processor = true;
  abilities.exact_times = abilities.clock = abilities.task = !abilities.realtime;
}
void Add(const Program& /*program*/, ClientAbilities& /*abilities*/) {}
void Add(const LockstepProgram& program, ClientAbilities& abilities) {
  abilities.virtual_time = true;
  abilities.wall_time = false;
  abilities.clock = abilities.reset = abilities.task = !abilities.realtime;
  abilities.computing = !abilities.realtime && !program.clocked;
}
void Add(const SerialBoard& /*board*/, ClientAbilities& abilities) { abilities.node = false; }

}  // namespace

std::optional<int> LineUsart(const EmulatedImage& image, const std::string& line, std::size_t index) {
  if (const auto named = image.line_usarts.find(line); named != image.line_usarts.end()) return named->second;
  constexpr std::array<int, 2> kOfShipped = {6, 4};
  const bool knows = image.file.empty() && image.line_usarts.empty() && index < kOfShipped.size();
  return knows ? std::optional(kOfShipped.at(index)) : std::nullopt;
}

std::span<const ClientForm> ClientForms() { return kForms; }

ClientSpec ParseClient(const std::string& text) {
  if (text == "host") return HostLibrary{};
  if (text == "qemu") return EmulatedImage{};
  if (text.starts_with("qemu,"))
    throw ClientMistake(fmt::format("USARTs follow an image: qemu:executive{}", text.substr(4)));
  const std::size_t colon = text.find(':');
  const std::string kind = text.substr(0, colon);
  const std::string rest = colon == std::string::npos ? "" : text.substr(colon + 1);
  if (kind == "host")
    throw ClientMistake("nothing follows `host`; library:FILE is a firmware library of yours");
  if (kind == "qemu") return ReadImage(rest);
  const bool clocked = kind == "clocked";
  if (!clocked && std::find(kKinds.begin(), kKinds.end(), kind) == kKinds.end()) ThrowUnknownKind(kind);
  if (rest.find_first_not_of(' ') == std::string::npos) throw ClientMistake("names nothing");
  if (kind == "library") return HostLibrary{Absolute(rest)};
  if (kind == "program") return LockstepProgram{rest};
  if (clocked) return LockstepProgram{ReadProgram(rest).command, true};
  if (kind == "process") return ReadProgram(rest);
  return ReadBoard(rest);
}

std::string ToText(const ClientSpec& client) {
  return std::visit([](const auto& kind) { return TextOf(kind); }, client);
}

const ClientSpec& RunClients::Of(const std::string& id) const {
  const auto found = by_id.find(id);
  return found == by_id.end() ? all : found->second;
}

std::vector<ClientSpec> RunClients::Named() const {
  std::vector<ClientSpec> named = {all};
  for (const auto& [id, client] : by_id) named.push_back(client);
  return named;
}

std::string_view KindOf(const ClientSpec& client) { return kKinds[client.index()]; }

std::optional<ClientSpec> ClientOfKind(std::string_view kind) {
  for (const ClientSpec& client :
       {ClientSpec(HostLibrary{}), ClientSpec(EmulatedImage{}), ClientSpec(Program{}),
        ClientSpec(SerialBoard{}), ClientSpec(LockstepProgram{})})
    if (KindOf(client) == kind) return client;
  return std::nullopt;
}

ClientAbilities AbilitiesOf(const ClientSpec& client, bool realtime) {
  ClientAbilities abilities{.realtime = realtime};
  std::visit([&](const auto& kind) { Add(kind, abilities); }, client);
  return abilities;
}

}  // namespace tiltproof::harness
