// The links of a vehicle as a tree from its base: which joints are hinges, and which links are lumped into what
// carries them. Internal to LoadVehicle.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "plant/sdf_files.h"
#include "plant/vehicle_elements.h"

namespace tiltproof::plant {

struct TreeJoint {
  const SdfPart* part = nullptr;
  std::string type, parent, child;             // full names of links
  std::optional<double> lower_rad, upper_rad;  // as stated: also infinite
  double effort = 0, velocity = 0;             // 0: not stated, or without a limit
  bool is_hinge = false;

  const std::string& name() const { return part->name; }
};

class VehicleTree {
 public:
  explicit VehicleTree(const SdfFiles& files);

  // Completes `elements`: the base and the servos, where plugins name the rotors. Adds errors of names that do
  // not exist to `problems`, and where there is no problem those of the tree.
  void Assign(VehicleElements& elements, std::vector<VehicleProblem>& problems);

  // Null when there is none.
  const TreeJoint* Joint(const std::string& name) const;
  // The base, or the link of the hinge, that the link is a part of.
  const std::string& BodyOf(const std::string& link) const;
  // The hinge whose link this is; null for any other link.
  const TreeJoint* HingeOf(const std::string& link) const;
  // Names of the joints that are hinges.
  std::set<std::string> hinges() const;
  // A part of another link's body. False for all links of a tree with a problem.
  bool IsRigid(const std::string& link) const;
  const std::vector<TreeJoint>& joints() const { return joints_; }
  // The links that carry no rotor, in the order of the files.
  const std::vector<std::string>& lumped() const { return lumped_; }

 private:
  std::vector<const TreeJoint*> JointsTo(const std::string& link) const;
  void FindBase(VehicleElements& elements) const;
  void CheckRoles(const VehicleElements& elements, std::vector<VehicleProblem>& problems) const;
  void CheckLinks(const VehicleElements& elements, std::vector<VehicleProblem>& problems);
  void WalkUp(const RotorElement& rotor, VehicleElements& elements, std::vector<VehicleProblem>& problems);
  bool IsHinge(const TreeJoint& joint, const RotorElement& rotor, VehicleElements& elements,
               std::vector<VehicleProblem>& problems) const;
  void CheckServos(const VehicleElements& elements, std::vector<VehicleProblem>& problems) const;

  const SdfFiles& files_;
  std::vector<TreeJoint> joints_;
  std::string base_;
  std::set<std::string> carriers_;            // of rotors, and the base
  std::map<std::string, std::string> above_;  // the parent of each link but the base
  std::vector<std::string> lumped_;
};

}  // namespace tiltproof::plant
