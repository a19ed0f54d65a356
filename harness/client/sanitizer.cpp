#include "harness/client/sanitizer.h"

#include <dlfcn.h>
#include <elf.h>
#include <fmt/format.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <vector>

#include "harness/client/firmware_files.h"
#include "link/posix_regex.h"

#ifndef TILTPROOF_SANITIZED
// The sanitizers ask for these. A signal that they leave alone is a FirmwareGuard's.
extern "C" {
// NOLINTBEGIN(bugprone-reserved-identifier, cert-dcl37-c, cert-dcl51-cpp, readability-identifier-naming)
const char* __asan_default_options() {
  return "abort_on_error=1:detect_leaks=0:use_sigaltstack=0:handle_segv=0:handle_sigbus=0:handle_sigfpe=0:"
         "handle_sigill=0:handle_abort=0";
}
const char* __ubsan_default_options() { return "abort_on_error=1:halt_on_error=1"; }
// NOLINTEND(bugprone-reserved-identifier, cert-dcl37-c, cert-dcl51-cpp, readability-identifier-naming)
}
#endif

namespace tiltproof::harness {
namespace {

std::vector<std::string> Words(const std::string& bytes) {
  std::vector<std::string> words;
  for (std::size_t at = 0; at < bytes.size(); at += words.back().size() + 1)
    words.emplace_back(bytes.c_str() + at);
  return words;
}

std::string ReadBytes(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

template <class T>
std::optional<T> At(const std::string& bytes, std::uint64_t offset) {
  T value;
  if (offset > bytes.size() || bytes.size() - offset < sizeof value) return std::nullopt;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

// Names of the symbols and libraries that it uses, and its own. Empty when it is no library: loading it reports why.
std::vector<std::string> DynamicNames(const std::filesystem::path& library) {
  const std::string bytes = ReadBytes(library);
  const auto header = At<Elf64_Ehdr>(bytes, 0);
  if (!header || std::memcmp(header->e_ident, ELFMAG, SELFMAG) != 0 ||
      header->e_ident[EI_CLASS] != ELFCLASS64)
    return {};
  const auto section_at = [&](std::uint64_t number) {
    return At<Elf64_Shdr>(bytes, header->e_shoff + number * sizeof(Elf64_Shdr));
  };
  for (std::uint64_t i = 0; i < header->e_shnum; ++i) {
    const auto section = section_at(i);
    if (!section || section->sh_type != SHT_DYNSYM) continue;
    const auto strings = section_at(section->sh_link);
    if (!strings || strings->sh_offset > bytes.size()) return {};
    return Words(bytes.substr(strings->sh_offset, strings->sh_size));
  }
  return {};
}

// Where clang has its own; empty when there is no clang, or it has none.
std::string ClangRuntime(const std::string& name) {
  utsname machine{};
  uname(&machine);
  const std::string file = fmt::format("libclang_rt.{}-{}.so", name, machine.machine);
  FILE* clang = popen(("clang -print-file-name=" + file + " 2>/dev/null").c_str(), "r");
  if (clang == nullptr) return {};
  std::string path;
  std::array<char, 4096> buffer;
  while (std::fgets(buffer.data(), buffer.size(), clang) != nullptr) path += buffer.data();
  pclose(clang);
  while (!path.empty() && path.back() == '\n') path.pop_back();
  return std::filesystem::path(path).is_absolute() && std::filesystem::exists(path) ? path : "";
}

[[noreturn]] void StartAnewWith(const std::string& runtime) {
  const char* others = std::getenv("LD_PRELOAD");
  const std::string all = others == nullptr ? runtime : fmt::format("{}:{}", runtime, others);
  setenv("LD_PRELOAD", all.c_str(), 1);
  std::vector<std::string> words = Words(ReadBytes("/proc/self/cmdline"));
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  std::fflush(nullptr);
  execv(ProgramFile().c_str(), arguments.data());
  throw std::runtime_error(fmt::format("cannot start this program with the library's sanitizer {}: {}",
                                       runtime, std::strerror(errno)));
}

// True for a line that glibc prints before it aborts.
bool IsTheCLibrarys(std::string_view line) {
  constexpr std::array kBegin = {"*** stack smashing detected ***",
                                 "*** buffer overflow detected ***",
                                 "malloc(): ",
                                 "malloc_consolidate(): ",
                                 "realloc(): ",
                                 "free(): ",
                                 "munmap_chunk(): ",
                                 "double free or corruption",
                                 "corrupted size vs. prev_size",
                                 "corrupted double-linked list",
                                 "terminate called "};
  return std::ranges::any_of(kBegin, [&](const char* begin) { return line.starts_with(begin); }) ||
         (line.find(": Assertion `") != line.npos && line.ends_with("' failed."));
}

}  // namespace

void PreloadSanitizer(const std::filesystem::path& library) {
  const std::vector<std::string> names = DynamicNames(library);
  const auto find = [&](std::string_view begin) -> std::string {
    const auto found = std::ranges::find_if(names, [&](const auto& name) { return name.starts_with(begin); });
    return found == names.end() ? "" : *found;
  };
  const bool address = !find("__asan_init").empty();
  const std::string symbol = address ? "__asan_init" : find("__ubsan_handle_");
  if (symbol.empty() || dlsym(RTLD_DEFAULT, symbol.c_str()) != nullptr) return;
  // gcc's for undefined behaviour is loaded as any library.
  if (!address && !find("libubsan.so").empty()) return;
  const std::string gccs = find("libasan.so");
  const std::string runtime = gccs.empty() ? ClangRuntime(address ? "asan" : "ubsan_standalone") : gccs;
  const std::string what =
      fmt::format("{} is built with -fsanitize={}", library.string(), address ? "address" : "undefined");
  if (runtime.empty())
    throw std::runtime_error(
        fmt::format("{}, and clang, which has what that needs, is not found; install clang and its runtimes "
                    "(Debian: clang libclang-rt-14-dev), or build the library with gcc, or name the "
                    "runtime's file: LD_PRELOAD=FILE tiltproof ...",
                    what));
  const char* preloaded = std::getenv("LD_PRELOAD");
  if (preloaded != nullptr && std::string_view(preloaded).find(runtime) != std::string_view::npos)
    throw std::runtime_error(
        fmt::format("{}, and its runtime {} cannot be loaded; install it (gcc's comes with gcc), or name its "
                    "file: LD_PRELOAD=FILE tiltproof ...",
                    what, runtime));
  StartAnewWith(runtime);
}

void AbortReport::SetPlace(std::string_view line) {
  // file.c:LINE, or LIBRARY+0xOFFSET
  static const PosixRegex source("[^[:space:]:(]+\\.[[:alnum:]_]+:[0-9]+(:[0-9]+)?");
  static const PosixRegex offset("[^[:space:](]+\\+0x[0-9a-f]+");
  place_.clear();
  for (const PosixRegex* place : {&source, &offset}) {
    if (const auto found = place->Find(line)) {
      place_ = *found;
      return;
    }
  }
}

void AbortReport::Look(std::string_view line) {
  constexpr std::size_t kTextMax = 400;
  const auto find = [&](std::string_view text) { return line.find(text); };
  if (LookForTraceback(line)) return;
  if (const std::size_t at = find("ERROR: AddressSanitizer: "); at != line.npos) {
    text_ = line.substr(at, std::min(line.find(" on ", at), line.find(" (", at)) - at).substr(0, kTextMax);
    lacks_place_ = true;
    names_place_ = false;
    place_.clear();
  } else if (find(": runtime error: ") != line.npos) {
    text_ = line.substr(0, kTextMax);
    lacks_place_ = false;
    names_place_ = true;
    SetPlace(text_);
  } else if (const std::size_t in = find(" in "); lacks_place_ && in != line.npos) {
    // "    #1 0x7f0c in Decode decoder.c:33". A function of the C library is the sanitizer's, in its own source.
    const std::size_t number = line.find_first_not_of(' ');
    constexpr std::array kItsOwn = {"interceptor", "libsanitizer", "compiler-rt", "libclang_rt",
                                    " in __asan_"};
    if (line[number] != '#' ||
        std::ranges::any_of(kItsOwn, [&](const char* word) { return find(word) != line.npos; }))
      return;
    text_ += line.substr(in, std::min(line.find(" (BuildId", in) - in, kTextMax));
    lacks_place_ = false;
    names_place_ = true;
    SetPlace(line.substr(in));
  } else if (IsTheCLibrarys(line)) {
    // "PROGRAM: FILE:LINE: FUNCTION: Assertion `...' failed."
    names_place_ = line.ends_with("' failed.");
    const std::string program = fmt::format("{}: ", program_invocation_short_name);
    text_ = line.substr(line.starts_with(program) ? program.size() : 0, kTextMax);
    lacks_place_ = false;
    place_.clear();
    if (names_place_) SetPlace(text_);
  } else if (find("' panicked at ") != line.npos || line.starts_with("raised ")) {
    // Rust: "thread 'main' panicked at 'MESSAGE', FILE:LINE:COLUMN". Ada: "raised EXCEPTION : FILE:LINE MESSAGE".
    text_ = line.substr(0, kTextMax);
    lacks_place_ = false;
    SetPlace(text_);
    names_place_ = !place_.empty();
  }
}

// Python prints the frames, the innermost last, then the exception.
bool AbortReport::LookForTraceback(std::string_view line) {
  constexpr std::string_view kFile = "  File \"", kLine = "\", line ";
  if (line == "Traceback (most recent call last):") {
    in_traceback_ = true;
    frame_.clear();
    return true;
  }
  if (!in_traceback_) return false;
  if (const std::size_t number = line.find(kLine); line.starts_with(kFile) && number != line.npos) {
    const std::string_view behind = line.substr(number + kLine.size());
    frame_ = fmt::format("{}:{}", line.substr(kFile.size(), number - kFile.size()),
                         behind.substr(0, behind.find(',')));
  }
  if (line.empty() || line.front() == ' ') return true;
  in_traceback_ = lacks_place_ = false;
  names_place_ = !frame_.empty();
  place_ = frame_;
  text_ = frame_.empty() ? std::string(line) : fmt::format("{} at {}", line, frame_);
  return true;
}

}  // namespace tiltproof::harness
