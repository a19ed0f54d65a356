// The shapes with which a vehicle touches the ground, from the <collision> elements of its links. Internal to
// LoadVehicle.
#pragma once

#include <sdf/Link.hh>
#include <string>
#include <vector>

#include "plant/vehicle_model.h"

namespace tiltproof::plant {

// Appends the link's boxes, spheres and cylinders; other shapes have no effect. `body` is the link of the body of which
// this one is a part, in libsdformat's names. `as` has what the shapes share: link and hinge. Returns a message of
// libsdformat when a pose cannot be resolved, else an empty text.
std::string AddShapes(const sdf::Link& link, const std::string& body, const CollisionShape& as,
                      std::vector<CollisionShape>& shapes);

// The box of uniform density with the body's mass and inertia.
CollisionShape InertiaBox(const RigidBody& base);

}  // namespace tiltproof::plant
