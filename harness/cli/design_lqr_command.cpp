#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <fstream>
#include <memory>
#include <string>

#include "harness/cli/gain_header.h"
#include "harness/cli/lqr_weights.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/terminal/terminal.h"
#include "plant/lqr_design.h"

namespace tiltproof::harness {
namespace {

constexpr std::size_t kFirstHinge = 6;  // of the states, behind position and attitude

// "f_r_n" -> "f_r"
std::string WithoutUnit(const Signal& signal) { return signal.name.substr(0, signal.name.rfind('_')); }

struct DesignLqrOptions {
  std::string model;
  std::filesystem::path weights;
  double period_ms = 12;
  std::filesystem::path csv, header;
  std::string firmware_table;
  bool allow_invalid_inertia = false;
};

plant::LqrDesign Design(const DesignLqrOptions& options, const plant::VehicleModel& model) {
  plant::LqrOptions how;
  how.period_s = options.period_ms * 1e-3;
  if (!options.weights.empty())
    how.weights = ReadLqrWeights(options.weights, model, plant::DefaultWeights(model));
  return plant::DesignLqr(model, how);
}

void WriteHeader(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw UsageError(fmt::format("--header {}: cannot be written", file.string()));
}

void PrintDesign(const plant::VehicleModel& model, const plant::LqrDesign& design) {
  const plant::Hover& hover = design.hover;
  const VehicleSignals signals = model.signals();
  std::string angles = fmt::format("roll {:.6f}  pitch {:.6f}", hover.roll_rad, hover.pitch_rad);
  for (std::size_t i = 0; i < hover.hinge_rad.size(); ++i)
    angles += fmt::format("  {} {:.6f}", WithoutUnit(signals.states[kFirstHinge + i]), hover.hinge_rad[i]);
  std::string inputs, rows;
  for (std::size_t i = 0; i < signals.inputs.size(); ++i) {
    const std::string name = WithoutUnit(signals.inputs[i]);
    inputs += fmt::format("{}{} {:.5f}", i == 0 ? "" : "  ", name, hover.input.at(i));
    if (i + 1 == signals.inputs.size() || signals.inputs[i + 1].unit != signals.inputs[i].unit)
      inputs += " " + signals.inputs[i].unit;
    rows += " " + name;
  }
  Print(stdout, "model            {} ({:.4f} kg)\n", model.name, model.MassTotal());
  Print(stdout, "hover            {} rad\n", angles);
  Print(stdout, "                 {}\n", inputs);
  Print(stdout, "sampling period  {:.3f} ms\n", design.model.period_s * 1e3);
  if (design.input_weight_factor > 1)
    Print(stdout, "input weights    {:g} times the default, for a delay margin of {:.1f} ms or more\n",
          design.input_weight_factor, plant::DelayToTolerate(model, design.model.period_s) * 1e3);
  Print(stdout, "spectral radius  {:.6f} of the closed loop\n", design.spectral_radius);
  Print(stdout, "delay margin     {:.2f} ms of input delay\n", design.delay_margin_s * 1e3);
  Print(stdout, "Riccati residual {:.1e} after {} iterations\n", design.dare_residual,
        design.dare_iterations);
  Print(stdout, "gain             u = u_eq - K (x - x_ref), rows{}\n{}", rows,
        TextLines(plant::GainCsv(design.gain)));
}

int DesignLqrCommand(const DesignLqrOptions& options) {
  const std::filesystem::path file = ResolveModel(options.model);
  ModelCache models;
  std::shared_ptr<const plant::VehicleModel> model;
  plant::LqrDesign design;
  try {
    model = models.Load(file, options.allow_invalid_inertia);
    for (const auto& warning : models.warnings()) Print(stderr, "warning: {}\n", warning);
    design = Design(options, *model);
  } catch (const plant::VehicleError& error) {
    throw UsageError(error.what());
  } catch (const plant::DesignError& error) {
    throw UsageError(fmt::format("{}: {}", file.string(), error.what()));
  }
  if (!options.firmware_table.empty()) {
    if (design.gain.rows() != 4 || design.gain.cols() != 20)
      throw UsageError(
          fmt::format("--firmware-table: the shipped firmware takes a gain of 4 x 20, for two rotors "
                      "that tilt; this vehicle's is {} x {}. Write it with --csv",
                      design.gain.rows(), design.gain.cols()));
    Print(stdout, "{}", TextLines(plant::FirmwareGainTable(design.gain, options.firmware_table)));
    return kExitGreen;
  }
  PrintDesign(*model, design);
  if (!options.csv.empty()) plant::WriteGainCsv(options.csv, design.gain);
  if (!options.header.empty()) WriteHeader(options.header, GainHeader(*model, design));
  return kExitGreen;
}

}  // namespace

void RegisterDesignLqr(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<DesignLqrOptions>();
  CLI::App* command = program.add_subcommand(
      "design-lqr", "Design the DLQR of a vehicle: equilibrium, gain, spectral radius, delay margin");
  command->add_option("MODEL", options->model, "A model's name, or a path ending in .sdf")->required();
  command->add_option(
      "--weights", options->weights,
      "YAML or CSV file: weights by the names of states, integrals and inputs (x_m: 5); a name "
      "that it lacks keeps the default");
  command
      ->add_option("--period_ms", options->period_ms,
                   "Control period; the protocols 'paper' and 'provant' have 12 ms")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  command->add_option(
      "--csv", options->csv,
      "Write the gain (4x20 for the tilt-rotor): a row for each input, thrusts and then servos; no "
      "header. A scenario takes it by `gain: FILE`");
  command->add_option("--header", options->header,
                      "Write a C header for your firmware: gain, hover, limits, names, period");
  command->add_option("--firmware-table", options->firmware_table,
                      "Print the gain as a binary32 table of that name for firmware/gain_tables.h");
  command->add_flag("--allow-invalid-inertia", options->allow_invalid_inertia,
                    "Go on with a physically impossible inertia");
  command->footer(
      "Columns of the gain, the states x of u = u_eq - K (x - x_ref): x y z (m), roll pitch yaw and the "
      "angles of the hinges (rad), the rates of all these in the same order (m/s, rad/s; Euler rates), "
      "then the integrals of the errors of x y z (m s) and yaw (rad s), by the trapezoidal rule with the "
      "present error. `firmware: lqr` flies it, and firmware/examples shows how your own does.");
  SetAction(*command, line, [options] { return DesignLqrCommand(*options); });
}

}  // namespace tiltproof::harness
