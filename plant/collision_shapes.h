// The shapes with which a vehicle touches the ground, from the <collision> elements of its links. Internal to
// LoadVehicle.
#pragma once

#include <cstddef>
#include <optional>
#include <sdf/Link.hh>
#include <vector>

#include "plant/vehicle_model.h"

namespace tiltproof::plant {

// The body of which a link is a part.
struct ShapeOwner {
  std::string body;                  // the body's own link
  std::optional<std::size_t> hinge;  // none: the main body
};

// Appends the link's boxes, spheres and cylinders; other shapes have no effect. Returns a message of libsdformat
// when a pose cannot be resolved, else an empty text.
std::string AddShapes(const sdf::Link& link, const ShapeOwner& owner, std::vector<CollisionShape>& shapes);

// The box of uniform density with the body's mass and inertia.
CollisionShape InertiaBox(const RigidBody& base);

}  // namespace tiltproof::plant
