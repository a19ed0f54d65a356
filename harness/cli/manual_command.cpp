#include "harness/cli/commands.h"
#include "harness/cli/manual.h"
#include "harness/report/files.h"

namespace tiltproof::harness {

int ManualCommand(const CommandRow& program, const std::filesystem::path& folder, const std::string& date) {
  std::map<std::string, std::string> files = ManualPages(program, date);
  files[program.name + ".bash"] = BashCompletion(program);
  files["_" + program.name] = ZshCompletion(program);
  std::filesystem::create_directories(folder);
  for (const auto& [name, text] : files) WriteFile(folder / name, text);
  return kExitGreen;
}

}  // namespace tiltproof::harness
