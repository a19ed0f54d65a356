#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/terminal/terminal.h"
#include "plant/lqr_design.h"

namespace tiltproof::harness {
namespace {

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
    Print(stdout, "{}", TextLines(plant::FirmwareGainTable(design.gain, options.firmware_table)));
    return kExitGreen;
  }
  const plant::Hover& hover = design.hover;
  Print(stdout, "model            {} ({:.4f} kg)\n", model->name, model->MassTotal());
  Print(stdout, "hover            roll {:.6f}  pitch {:.6f}  alpha_r {:.6f}  alpha_l {:.6f} rad\n",
        hover.roll_rad, hover.pitch_rad, hover.hinge_rad.at(0), hover.hinge_rad.at(1));
  Print(stdout, "                 f_r {:.5f}  f_l {:.5f} N  tau_r {:.5f}  tau_l {:.5f} N m\n",
        hover.input.at(0), hover.input.at(1), hover.input.at(2), hover.input.at(3));
  Print(stdout, "sampling period  {:.3f} ms\n", design.model.period_s * 1e3);
  Print(stdout, "spectral radius  {:.6f} of the closed loop\n", design.spectral_radius);
  Print(stdout, "delay margin     {:.2f} ms of input delay\n", design.delay_margin_s * 1e3);
  Print(stdout, "Riccati residual {:.1e} after {} iterations\n", design.dare_residual,
        design.dare_iterations);
  Print(stdout, "gain             u = u_eq - K (x - x_ref), rows f_r f_l tau_r tau_l\n{}",
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
  command->add_option("--csv", options->csv, "Write the 4x20 gain: rows f_R f_L tau_R tau_L, no header");
  command->add_option("--firmware-table", options->firmware_table,
                      "Print the gain as a binary32 table of that name for firmware/gain_tables.h");
  command->add_flag("--allow-invalid-inertia", options->allow_invalid_inertia,
                    "Go on with a physically impossible inertia");
  command->footer(
      "Columns of the gain, the states x of u = u_eq - K (x - x_ref): x y z (m), roll pitch yaw alpha_r "
      "alpha_l "
      "(rad), their eight rates in the same order (m/s, rad/s; Euler rates), then the integrals of the "
      "errors of "
      "x y z (m s) and yaw (rad s), by the trapezoidal rule with the present error, every 12 ms. "
      "firmware/examples/python flies it.");
  SetAction(*command, line, [options] { return DesignLqrCommand(*options); });
}

}  // namespace tiltproof::harness
