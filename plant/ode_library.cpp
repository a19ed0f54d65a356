#include "plant/ode_library.h"

#include <fmt/core.h>
#include <ode/ode.h>

#include <array>
#include <cstdarg>
#include <cstdio>

#include "plant/plant.h"

namespace tiltproof::plant {
namespace {

// ODE calls its handlers where it would otherwise print and abort. They must not return to it.
[[noreturn]] void ThrowOdeError(int number, const char* format, std::va_list arguments) {
  std::array<char, 256> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  throw PlantError(fmt::format("ODE error {}: {}", number, text.data()));
}

// Its warnings (a singular constraint solved anyway) would go to stderr in the middle of a flight; what comes
// of them shows in the state.
void IgnoreOdeMessage(int, const char*, std::va_list) {}

}  // namespace

// ODE's library state: once per process, its scratch data once per thread.
void InitialiseOde() {
  struct Library {
    Library() {
      dInitODE2(0);
      dSetErrorHandler(ThrowOdeError);
      dSetDebugHandler(ThrowOdeError);
      dSetMessageHandler(IgnoreOdeMessage);
    }
    ~Library() { dCloseODE(); }
    Library(const Library&) = delete;
    Library& operator=(const Library&) = delete;
  };
  static const Library library;
  thread_local const bool has_thread_data =
      dAllocateODEDataForThread(static_cast<unsigned int>(dAllocateMaskAll)) != 0;
  if (!has_thread_data) throw PlantError("ODE cannot allocate its data");
}

}  // namespace tiltproof::plant
