#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>
#include <string>

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
  std::filesystem::path csv;
  std::string firmware_table;
  bool allow_invalid_inertia = false;
};

int DesignLqrCommand(const DesignLqrOptions& options) {
  const std::filesystem::path file = ResolveModel(options.model);
  ModelCache models;
  std::shared_ptr<const plant::VehicleModel> model;
  plant::LqrDesign design;
  try {
    model = models.Load(file, options.allow_invalid_inertia);
    for (const auto& warning : models.warnings()) Print(stderr, "warning: {}\n", warning);
    design = plant::DesignLqr(*model);
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
  const plant::Hover& hover = design.hover;
  const VehicleSignals signals = model->signals();
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
  Print(stdout, "model            {} ({:.4f} kg)\n", model->name, model->MassTotal());
  Print(stdout, "hover            {} rad\n", angles);
  Print(stdout, "                 {}\n", inputs);
  Print(stdout, "sampling period  {:.3f} ms\n", design.model.period_s * 1e3);
  Print(stdout, "spectral radius  {:.6f} of the closed loop\n", design.spectral_radius);
  Print(stdout, "delay margin     {:.2f} ms of input delay\n", design.delay_margin_s * 1e3);
  Print(stdout, "Riccati residual {:.1e} after {} iterations\n", design.dare_residual,
        design.dare_iterations);
  Print(stdout, "gain             u = u_eq - K (x - x_ref), rows{}\n{}", rows,
        TextLines(plant::GainCsv(design.gain)));
  if (!options.csv.empty()) plant::WriteGainCsv(options.csv, design.gain);
  return kExitGreen;
}

}  // namespace

void RegisterDesignLqr(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<DesignLqrOptions>();
  CLI::App* command = program.add_subcommand(
      "design-lqr", "Design the DLQR of a model: equilibrium, gain, spectral radius, delay margin");
  command->add_option("MODEL", options->model, "A model's name, or a path ending in .sdf")->required();
  command->add_option(
      "--csv", options->csv,
      "Write the gain (4x20 for the tilt-rotor): rows are thrusts, then servo torques; no header");
  command->add_option("--firmware-table", options->firmware_table,
                      "Print the gain as a binary32 table of that name for firmware/gain_tables.h");
  command->add_flag("--allow-invalid-inertia", options->allow_invalid_inertia,
                    "Go on with a physically impossible inertia");
  command->footer(
      "Columns of the gain, the states x of u = u_eq - K (x - x_ref): x y z (m), roll pitch yaw and the "
      "angles of the hinges (rad), the rates of all these in the same order (m/s, rad/s; Euler rates), "
      "then the integrals of the errors of x y z (m s) and yaw (rad s), by the trapezoidal rule with the "
      "present error, every 12 ms. firmware/examples/python flies that of the tilt-rotor.");
  SetAction(*command, line, [options] { return DesignLqrCommand(*options); });
}

}  // namespace tiltproof::harness
