// The firmware that flies: the value of `--client`. This file is the one place that parses and writes it. The
// same text goes to the nodes and into run.json, and is read back for a replay.
//
//   const ClientSpec client = ParseClient("qemu:/fw/fw.elf,main=usart1,console=usart2");
//   std::get<EmulatedImage>(client).main_usart;           // 1
//   ToText(client);                                        // "qemu:/fw/fw.elf,main=usart1,console=usart2"
//   AbilitiesOf(client, realtime).processor;               // true: faults on the processor are possible
//
// harness/client makes a client from it, and knows where the shipped firmware is.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace tiltproof::harness {

// A firmware built as a shared library for this machine (firmware/tiltproof_client.h).
struct HostLibrary {
  std::string file;  // absolute; empty: the shipped firmware
  friend bool operator==(const HostLibrary&, const HostLibrary&) = default;
};

// An image for the STM32F4, unmodified, on an emulated board.
struct EmulatedImage {
  std::string file;                     // absolute; empty: the scenario's build of the shipped firmware,
  std::string scheduler = "executive";  // under this scheduler: executive or freertos
  int main_usart = 2, reference_usart = 3, console_usart = 1;  // 1 to 6, all different
  std::map<std::string, int> line_usarts = {};                 // of lines to other boards, by the line's id
  int hse_hz = 8'000'000;  // the board's crystal, up to 50 MHz; 0: there is none
  friend bool operator==(const EmulatedImage&, const EmulatedImage&) = default;
};

// The USART of the image's `index`-th line to another board; nullopt: not known. The shipped images have theirs
// (firmware/ports/stm32f4/other_boards.h), unless the text names some.
std::optional<int> LineUsart(const EmulatedImage& image, const std::string& line, std::size_t index);

// A program with two serial ports.
struct Program {
  // Words that a command may hold in braces, `{port}`: replaced before it runs.
  static constexpr std::array<std::string_view, 3> kPlaceholders = {"port", "reference_port", "baud"};
  std::string command;  // for sh -c
  friend bool operator==(const Program&, const Program&) = default;
};

// A program that flies in lockstep over a socket (docs/program.md).
struct LockstepProgram {
  std::string command;  // for sh -c
  // It only knows serial ports and the system's clock: a preloaded clock speaks for it, and the command may hold the words of
  // Program.
  bool clocked = false;
  friend bool operator==(const LockstepProgram&, const LockstepProgram&) = default;
};

// A board on serial ports of this machine, or on the sockets of an emulator.
struct SerialBoard {
  std::string device, reference_device;                  // /dev/..., unix:PATH; the second may be empty
  std::map<std::string, std::string> line_devices = {};  // of lines to other boards, by the line's id
  // The reset before each flight: "dtr" or "rts", lines of the first device's adapter, or a command for sh -c.
  // Empty: a person resets the board.
  std::string reset = {};
  friend bool operator==(const SerialBoard&, const SerialBoard&) = default;
};

using ClientSpec = std::variant<HostLibrary, EmulatedImage, Program, SerialBoard, LockstepProgram>;

// One form of the text, for a help page.
struct ClientForm {
  std::string_view form;  // "library:FILE"
  std::string_view text;
};
std::span<const ClientForm> ClientForms();

// A text that names no client. what() says why, and what to write instead; it does not repeat the text.
struct ClientMistake : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Paths become absolute. Does not check that the file or device exists. Throws ClientMistake.
ClientSpec ParseClient(const std::string& text);
// The shortest form that ParseClient() reads as the same client.
std::string ToText(const ClientSpec& client);

// The clients of a run: one that holds for every client of its scenarios, and others for some ids.
struct RunClients {
  ClientSpec all = HostLibrary{};
  std::map<std::string, ClientSpec> by_id;

  const ClientSpec& Of(const std::string& id) const;
  // Every client that is named, `all` first.
  std::vector<ClientSpec> Named() const;
};

// Only its kind, for messages between nodes: a node's file or device means nothing to another host.
// "library", "qemu", "process", "serial" or "program". The reverse returns a client of that kind without names, or
// nullopt.
std::string_view KindOf(const ClientSpec& client);
std::optional<ClientSpec> ClientOfKind(std::string_view kind);

// The abilities of a client of this kind in a mode.
struct ClientAbilities {
  bool realtime = false;      // the mode; otherwise lockstep
  bool virtual_time = false;  // it can fly in lockstep
  bool wall_time = true;      // it can fly in real time
  bool shipped = false;       // it flies the shipped build that the scenario's `firmware` names
  bool guarded = false;       // its code runs in a process of the harness, under a FirmwareGuard
  bool node = true;           // in real time it has a node; otherwise it is on the link node's own ports
  // Faults that it can take:
  bool reset = false;        // it can be reset
  bool task = false;         // the harness can make its task run late
  bool computing = false;    // it may state its computing time, which the harness can stretch
  bool clock = false;        // the harness gives it its time, and can falsify it
  bool processor = false;    // its processor can be stopped and its memory changed
  bool exact_times = false;  // that, and its receiver, at exact virtual times
};
ClientAbilities AbilitiesOf(const ClientSpec& client, bool realtime);

}  // namespace tiltproof::harness
