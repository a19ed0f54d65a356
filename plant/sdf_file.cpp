#include "plant/sdf_file.h"

#include <fmt/core.h>

#include <algorithm>
#include <iostream>
#include <mutex>
#include <sstream>
#include <string>
#include <string_view>

namespace tiltproof::plant {
namespace {

// libsdformat, and the URDF reader that it falls back to, print to std::cerr besides returning errors. While
// one of these lives that text goes here.
class StderrCapture {
 public:
  StderrCapture() : lock_(Mutex()), previous_(std::cerr.rdbuf(text_.rdbuf())) {}
  ~StderrCapture() { std::cerr.rdbuf(previous_); }
  StderrCapture(const StderrCapture&) = delete;
  StderrCapture& operator=(const StderrCapture&) = delete;

 private:
  static std::mutex& Mutex() {
    static std::mutex mutex;
    return mutex;
  }
  std::lock_guard<std::mutex> lock_;
  std::ostringstream text_;
  std::streambuf* previous_;
};

}  // namespace

void LoadSdf(const std::filesystem::path& file, sdf::Root& root, std::vector<VehicleProblem>& problems) {
  sdf::Errors errors;
  std::string trouble;
  {
    const StderrCapture capture;
    try {
      // A name without a folder could resolve to a file of libsdformat's own.
      errors = root.Load(std::filesystem::absolute(file).string());
    } catch (const std::exception& error) {
      trouble = error.what();
    }
  }
  const auto is_told = [&problems](int line) {
    return std::any_of(problems.begin(), problems.end(),
                       [line](const VehicleProblem& problem) { return problem.line == line; });
  };
  if (!trouble.empty() && problems.empty())
    problems.push_back({file, 0, fmt::format("libsdformat cannot read it ({})", trouble)});
  // It stops at the first element that it cannot read, and then names all those around it too.
  const auto is_around = [](const sdf::Error& a, const sdf::Error& b) {
    constexpr std::string_view kReading = "Error reading element";
    return a.Message().starts_with(kReading) && b.Message().starts_with(kReading);
  };
  errors.erase(std::unique(errors.begin(), errors.end(), is_around), errors.end());
  for (const bool has_line : {true, false}) {
    // An error without a line follows from another problem, if there is another one.
    if (!has_line && !problems.empty()) break;
    for (const sdf::Error& error : errors) {
      // LoadVehicle's own error names the reason and the line, and can be waived.
      if (error.Code() == sdf::ErrorCode::LINK_INERTIA_INVALID) continue;
      const int line = std::max(error.LineNumber().value_or(0), 0);
      if ((line > 0) == has_line && !is_told(line)) problems.push_back({file, line, error.Message()});
    }
  }
}

}  // namespace tiltproof::plant
