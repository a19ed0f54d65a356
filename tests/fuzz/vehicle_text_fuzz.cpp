// The text of a vehicle file, as our own code reads it before and beside libsdformat: any XML is read with its lines, or
// refused with one. The target `sdf` reads whole vehicles, and is a hundred times as slow, because libsdformat reads its
// own description of SDF again for every file.
//
// Input: the SDF file.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "plant/vehicle_elements.h"
#include "plant/vehicle_mapping.h"
#include "plant/vehicle_tree.h"
#include "plant/vehicle_xml.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/scratch.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace plant = tiltproof::plant;
  using tiltproof::testing::Require;
  const auto file = tiltproof::testing::ScratchFile("fuzz.sdf", {data, size});
  const auto last_line = 1 + std::count(data, data + size, '\n');
  tiltproof::testing::Tried<plant::VehicleError>([&] {
    const plant::VehicleXml xml(file);
    std::vector<plant::VehicleProblem> problems;
    std::vector<std::string> warnings;
    xml.Check(problems);
    plant::VehicleElements elements = plant::ReadElements(xml.files(), {}, warnings, problems);
    plant::VehicleTree tree(xml.files());
    tree.Assign(elements, problems);
    xml.CheckInertials([](const std::string&) { return false; }, problems);
    for (const plant::VehicleProblem& problem : problems) {
      Require(!problem.message.empty(), "a problem is said");
      Require(problem.line >= 0 && problem.line <= last_line, "a problem has a line of the file");
    }
    for (const plant::RotorElement& rotor : elements.rotors) {
      Require(std::abs(rotor.axis.norm() - 1) < 1e-9, "an axis has a direction");
      Require(xml.Place("link", rotor.link).line <= last_line, "a link has a line of the file");
    }
    for (const plant::ServoElement& servo : elements.servos)
      Require(xml.Place("joint", servo.joint, "axis").line <= last_line, "a joint has a line of the file");
    Require(!problems.empty() || (!elements.rotors.empty() && elements.rotors.size() <= 8),
            "a vehicle without a problem has 1 to 8 rotors");
    plant::MissingElements(xml.files(), tree, elements);
    xml.WarnUnsupported(elements, tree.hinges(), warnings);
    for (const std::string& warning : warnings)
      Require(warning.starts_with(file.string()), "a warning has its place");
    return true;
  });
  return 0;
}
