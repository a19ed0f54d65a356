#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/report/files.h"
#include "harness/terminal/terminal.h"
#include "plant/vehicle_mapping.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {
namespace {

using plant::Hinge;
using plant::Rotor;
using plant::VehicleModel;

constexpr std::size_t kColumnsMax = 80;  // of a terminal

constexpr std::string_view kFillIn = "FILL_IN";  // of plant::VehicleMapping

// Rows of cells under their headings: the first columns, of names, are aligned to the left, the others to the
// right.
class Table {
 public:
  Table(std::size_t name_count, std::vector<std::string> headings)
      : name_count_(name_count), rows_{std::move(headings)} {}
  void Add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }

  std::string Text() const {
    std::vector<std::size_t> widths(rows_.front().size());
    for (const auto& row : rows_)
      for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
    std::string text;
    for (const auto& row : rows_) {
      for (std::size_t i = 0; i < row.size(); ++i) {
        if (i > 0) text += ' ';
        text += i < name_count_ ? fmt::format("{:<{}}", row[i], widths[i])
                                : fmt::format("{:>{}}", row[i], widths[i]);
      }
      text += '\n';
    }
    return text;
  }

 private:
  std::size_t name_count_;
  std::vector<std::vector<std::string>> rows_;
};

// Rounded, and never "-0.00".
std::string Number(double value, int digits) {
  const double unit = std::pow(10.0, -digits);
  return fmt::format("{:.{}f}", std::abs(value) < unit / 2 ? 0.0 : value, digits);
}

void AddVector(std::vector<std::string>& row, const Eigen::Vector3d& vector, int digits) {
  for (const double each : {vector.x(), vector.y(), vector.z()}) row.push_back(Number(each, digits));
}

std::string Rotors(const VehicleModel& model) {
  Table table(2, {"rotor", "on", "x_m", "y_m", "z_m", "ax", "ay", "az", "turns", "drag_m"});
  for (const Rotor& rotor : model.rotors) {
    Eigen::Vector3d p_BR_m = rotor.p_LR_m, axis_B = rotor.thrust_axis_L;
    std::vector<std::string> row = {rotor.name, "base"};
    if (rotor.hinge) {
      const Hinge& hinge = model.hinges[*rotor.hinge];
      row.back() = hinge.name;
      p_BR_m = hinge.p_BT_m + hinge.R_BT * p_BR_m;
      axis_B = hinge.R_BT * axis_B;
    }
    AddVector(row, p_BR_m, 3);
    AddVector(row, axis_B, 2);
    // The air turns the body against the propeller, and direction 1 is a torque along the thrust.
    row.emplace_back(rotor.drag_ratio_m == 0 ? "-" : rotor.direction > 0 ? "cw" : "ccw");
    row.push_back(Number(rotor.drag_ratio_m, 4));
    table.Add(std::move(row));
  }
  return table.Text();
}

std::string Hinges(const VehicleModel& model) {
  Table table(2, {"hinge", "joint", "x_m", "y_m", "z_m", "ax", "ay", "az", "from", "to_rad"});
  for (const Hinge& hinge : model.hinges) {
    std::vector<std::string> row = {hinge.name, hinge.joint};
    AddVector(row, hinge.p_BH_m, 3);
    AddVector(row, hinge.axis_B, 2);
    row.push_back(Number(hinge.angle_min_rad, 2));
    row.push_back(Number(hinge.angle_max_rad, 2));
    table.Add(std::move(row));
  }
  return table.Text();
}

// The lag and the speed limit behind input i: rises_s, falls_s, speed_rad_s.
std::vector<std::string> Response(const VehicleModel& model, std::size_t i) {
  const auto seconds = [](double value) { return value > 0 ? Number(value, 4) : std::string("-"); };
  if (i < model.rotors.size()) {
    const Rotor& rotor = model.rotors[i];
    return {seconds(rotor.time_constant_up_s), seconds(rotor.time_constant_down_s), "-"};
  }
  const Hinge& hinge = model.hinges[i - model.rotors.size()];
  if (hinge.servo == plant::ServoMode::kTorque) return {"-", "-", "-"};
  return {seconds(hinge.time_constant_s), seconds(hinge.time_constant_s), Number(hinge.speed_max_rad_s, 2)};
}

// An input of it has a lag or a speed limit.
bool RespondsSlowly(const VehicleModel& model) {
  return std::any_of(model.rotors.begin(), model.rotors.end(),
                     [](const Rotor& rotor) {
                       return rotor.time_constant_up_s > 0 || rotor.time_constant_down_s > 0;
                     }) ||
         std::any_of(model.hinges.begin(), model.hinges.end(),
                     [](const Hinge& hinge) { return hinge.servo == plant::ServoMode::kPosition; });
}

std::string Inputs(const VehicleModel& model) {
  std::vector<std::string> headings = {"input", "least", "hover", "most", "share"};
  const bool responds = RespondsSlowly(model);
  if (responds) headings.insert(headings.end(), {"rises_s", "falls_s", "speed_rad_s"});
  Table table(1, std::move(headings));
  const VehicleSignals signals = model.signals();
  for (std::size_t i = 0; i < signals.inputs.size(); ++i) {
    const Signal& input = signals.inputs[i];
    std::vector<std::string> row = {input.name, Number(input.min, 3)};
    if (i < model.hover.input.size()) {
      const double hover = model.hover.input[i], limit = hover < 0 ? input.min : input.max;
      row.push_back(Number(hover, 3));
      row.push_back(Number(input.max, 3));
      row.push_back(limit == 0 ? "-" : fmt::format("{:.0f} %", 100 * hover / limit));
    } else {
      row.insert(row.end(), {"-", Number(input.max, 3), "-"});
    }
    if (responds) {
      const std::vector<std::string> response = Response(model, i);
      row.insert(row.end(), response.begin(), response.end());
    }
    table.Add(std::move(row));
  }
  return table.Text();
}

// "states   x_m y_m ...", with further lines below the first name.
std::string Names(const std::string& title, const std::vector<std::string>& names) {
  constexpr std::size_t kIndent = 9;
  std::string text, line = fmt::format("{:<{}}", title, kIndent);
  for (const std::string& name : names) {
    if (line.size() > kIndent && line.size() + name.size() > kColumnsMax) {
      text += line.substr(0, line.size() - 1) + '\n';
      line = std::string(kIndent, ' ');
    }
    line += name + ' ';
  }
  return text + line.substr(0, line.size() - 1) + '\n';
}

std::string Signals(const VehicleModel& model) {
  const VehicleSignals signals = model.signals();
  std::vector<std::string> states, sensors;
  for (std::size_t i = 0; i < signals.states.size(); ++i) states.push_back(signals.states[i].name);
  for (std::size_t i = 0; i < signals.sensors.size(); ++i)
    if (!signals.states.Find(signals.sensors[i].name)) sensors.push_back(signals.sensors[i].name);
  sensors.insert(sensors.begin(), sensors.empty() ? "every state" : "every state, and");
  return Names("states", states) + Names("sensors", sensors);
}

// Attitude and hinge angles in hover; empty where there is none.
std::string HoverAngles(const VehicleModel& model) {
  if (model.hover.input.empty()) return {};
  std::vector<std::string> angles = {fmt::format("roll {}", Number(model.hover.roll_rad, 4)),
                                     fmt::format("pitch {}", Number(model.hover.pitch_rad, 4))};
  for (std::size_t i = 0; i < model.hinges.size(); ++i)
    angles.push_back(fmt::format("{} {}", model.hinges[i].name, Number(model.hover.hinge_rad.at(i), 4)));
  angles.back() += " rad";
  return Names("hover", angles);
}

// Writes `<stem>.tiltproof.xml` beside the file, where there is none.
int WriteMapping(const std::filesystem::path& file) {
  const std::filesystem::path mapping = std::filesystem::path(file).replace_extension(".tiltproof.xml");
  if (std::filesystem::exists(std::filesystem::symlink_status(mapping)))
    throw UsageError(fmt::format("{}: is there already; nothing was changed", mapping.string()));
  std::string text;
  try {
    text = plant::VehicleMapping(file);
  } catch (const plant::VehicleError& error) {
    throw UsageError(error.what());
  }
  WriteNewFile(mapping, text);
  std::size_t missing_count = 0;
  for (std::size_t at = text.find(kFillIn); at != std::string::npos; at = text.find(kFillIn, at + 1))
    ++missing_count;
  Print(stdout, "{}: {}\n", mapping.string(),
        missing_count == 0 ? "no number is missing"
                           : fmt::format("replace {} by a number, {} times", kFillIn, missing_count));
  return kExitGreen;
}

struct VehicleOptions {
  std::string file;
  bool writes_mapping = false, allow_invalid_inertia = false;
};

int VehicleCommand(const VehicleOptions& options) {
  std::vector<std::string> warnings;
  VehicleModel model;
  const std::filesystem::path file = ResolveModel(options.file);
  if (options.writes_mapping) return WriteMapping(file);
  try {
    model = plant::LoadVehicle(
        file, {.allow_invalid_inertia = options.allow_invalid_inertia, .allow_no_hover = true, .mapping = {}},
        warnings);
  } catch (const plant::VehicleError& error) {
    throw UsageError(error.what());
  }
  for (const std::string& warning : warnings) Print(stderr, "warning: {}\n", warning);
  Print(stdout, "{}: {:.6g} kg, {} rotor{} and {} hinge{}\n\n", model.name, model.MassTotal(),
        model.rotors.size(), model.rotors.size() == 1 ? "" : "s", model.hinges.size(),
        model.hinges.size() == 1 ? "" : "s");
  Print(stdout, "{}\n", TextLines(Rotors(model)));
  if (!model.hinges.empty()) Print(stdout, "{}\n", TextLines(Hinges(model)));
  Print(stdout, "{}\n", TextLines(Inputs(model)));
  Print(stdout, "{}", TextLines(Signals(model) + HoverAngles(model)));
  if (!model.no_hover.empty()) throw UsageError(model.no_hover);
  Print(stdout, "\nIt can hover.\n");
  return kExitGreen;
}

}  // namespace

void RegisterVehicle(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<VehicleOptions>();
  CLI::App* command = program.add_subcommand(
      "vehicle", "Print a vehicle's rotors, hinges, inputs and signals, and whether it can hover");
  command->add_option("FILE", options->file, "A path ending in .sdf, or a model's name")->required();
  command->add_flag("--mapping", options->writes_mapping,
                    "Write <stem>.tiltproof.xml beside the file instead: all that it reveals, and FILL_IN in "
                    "place of each number that it lacks");
  command->add_flag("--allow-invalid-inertia", options->allow_invalid_inertia,
                    "Go on with a physically impossible inertia");
  command->footer(
      "x y z, ax ay az: place and axis, in the frame of the base with all hinges at 0. turns: the "
      "propeller's sense, seen against its thrust (from above where the thrust points up). from, to: stops. "
      "Inputs have their limits and their value in hover, with its share of the limit; if any input is "
      "slow, also the lags of a rising and a falling value, and the servo's speed limit. A vehicle that "
      "cannot hover is printed with the reasons, and is an error (2).");
  SetAction(*command, line, [options] { return VehicleCommand(*options); });
}

}  // namespace tiltproof::harness
