// The ground: shapes that touch it, the joints that hold them, and touches that end a flight.
//
// Contacts are found at the end of a step, from the state that it reached. The next step holds their points with a
// joint each. So the velocity of a point at which a touch begins is still that of the approach.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "link/check.h"
#include "plant/plant_world.h"

namespace tiltproof::plant {
namespace {

using Eigen::Vector3d;

constexpr int kContactsMax = 8;  // of one shape
constexpr double kFriction = 0.8;
// A shape in the ground comes out of it with no more than this, so that a touch has no bounce.
constexpr double kLeavingMax_m_s = 0.02;
constexpr double kCorrected = 0.2;  // part of the depth that one step corrects
// Softness relative to the vehicle's mass: a resting vehicle sinks by g step^2 kSoftness / kCorrected, below 1 um
// at 4 ms. It makes the forces of more contacts than a body needs unique. The friction's is smaller because a
// push lets the vehicle creep in proportion to it: 0.3 mm in 100 s at 0.8 g.
constexpr double kSoftness = 1e-3, kSlip = 1e-4;
// Each further contact is softer by this part of the first one. ODE's solver gives up where forces are exactly equal,
// as those of two corners of a box that is pushed along its diagonal, and the vehicle jumps.
constexpr double kVaried = 0.1;
constexpr double kStill_m_s = 1e-9;

dGeomID CreateGeom(const CollisionShape& shape) {
  const Vector3d& size = shape.size_m;
  switch (shape.kind) {
    case CollisionShape::Kind::kBox:
      return dCreateBox(nullptr, size.x(), size.y(), size.z());
    case CollisionShape::Kind::kSphere:
      return dCreateSphere(nullptr, size.x());
    case CollisionShape::Kind::kCylinder:
      return dCreateCylinder(nullptr, size.x(), size.y());
  }
  ThrowBrokenInvariant("a kind of collision shape");
}

// Extent of the shape below its centre, where `up` is the world's z along the shape's axes.
double ExtentBelow(const CollisionShape& shape, const Vector3d& up) {
  switch (shape.kind) {
    case CollisionShape::Kind::kBox:
      return 0.5 * up.cwiseAbs().dot(shape.size_m);
    case CollisionShape::Kind::kSphere:
      return shape.size_m.x();
    case CollisionShape::Kind::kCylinder:
      return 0.5 * std::abs(up.z()) * shape.size_m.y() + std::hypot(up.x(), up.y()) * shape.size_m.x();
  }
  ThrowBrokenInvariant("a kind of collision shape");
}

Vector3d PointVelocity(const dContactGeom& geom) {
  dVector3 v;
  dBodyGetPointVel(dGeomGetBody(geom.g1), geom.pos[0], geom.pos[1], geom.pos[2], v);
  return ToVector(v);
}

}  // namespace

void Plant::World::CreateShapes() {
  reach_m = 0;
  for (const CollisionShape& from : model.shapes) {
    const Body& body = from.hinge ? tilting.at(*from.hinge).body : base;
    Shape& shape = shapes.emplace_back();
    shape.geom = CreateGeom(from);
    shape.radius_m = from.size_m.norm();
    const Vector3d p_CS = from.p_LS_m - body.p_com_m;
    const Matrix3d& r = from.R_LS;
    const dMatrix3 rows = {r(0, 0), r(0, 1), r(0, 2), 0,       r(1, 0), r(1, 1),
                           r(1, 2), 0,       r(2, 0), r(2, 1), r(2, 2), 0};
    dGeomSetBody(shape.geom, body.id);
    dGeomSetOffsetPosition(shape.geom, p_CS.x(), p_CS.y(), p_CS.z());
    dGeomSetOffsetRotation(shape.geom, rows);
    double away_m = p_CS.norm();
    if (from.hinge) {
      const Hinge& hinge = model.hinges[*from.hinge];
      away_m = (hinge.p_BH_m - base.p_com_m).norm() +
               (hinge.p_BT_m + hinge.R_BT * from.p_LS_m - hinge.p_BH_m).norm();
    }
    reach_m = std::max(reach_m, away_m + shape.radius_m);
  }
  contacts.reserve(shapes.size() * kContactsMax);
  dWorldSetContactMaxCorrectingVel(world, kLeavingMax_m_s);
}

void Plant::World::FindContacts() {
  contacts.clear();
  // Looking at the height first spares the collision of a flying vehicle; written so that NaN goes no
  // further.
  if (!options.ground || !(base.Com().z() <= reach_m)) return;
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    if (!(dGeomGetPosition(shapes[i].geom)[2] <= shapes[i].radius_m)) continue;
    std::array<dContactGeom, kContactsMax> found{};
    const int count = dCollide(shapes[i].geom, ground, kContactsMax, found.data(), sizeof(dContactGeom));
    Check(count >= 0 && static_cast<std::size_t>(count) <= found.size(),
          "ODE reports no more contacts than there is room for");
    for (std::size_t each = 0; each < static_cast<std::size_t>(count); ++each)
      contacts.push_back({found[each], i});
  }
}

// Friction acts against the velocity that the point would have at the end of the step without it. ODE limits friction
// along two axes; with the first along that velocity, a push slides at the same force in every direction.
void Plant::World::AddContactJoints(double length_s) {
  if (contacts.empty()) return;
  // The joints take the speed of the touch away, so a finer part of a step has to look before.
  if (options.touch_down_max_m_s && strike.empty()) strike = TouchProblem();
  Vector3d force_n = ToVector(dBodyGetForce(base.id));
  for (const Tilting& each : tilting) force_n += ToVector(dBodyGetForce(each.body.id));
  const double mass_kg = model.MassTotal();
  const Vector3d gained_m_s = force_n / mass_kg * length_s;
  double softer = 1;
  for (const Contact& each : contacts) {
    dContact contact{};
    contact.surface.mode =
        dContactSoftERP | dContactSoftCFM | dContactSlip1 | dContactSlip2 | dContactApprox1 | dContactFDir1;
    contact.surface.mu = kFriction;
    contact.surface.soft_erp = kCorrected;
    contact.surface.soft_cfm = softer * kSoftness * length_s / mass_kg;
    contact.surface.slip1 = contact.surface.slip2 = softer * kSlip * length_s / mass_kg;
    softer += kVaried;
    contact.geom = each.geom;
    Vector3d sliding_m_s = PointVelocity(each.geom) + gained_m_s;
    sliding_m_s.z() = 0;
    const double speed_m_s = sliding_m_s.norm();
    const Vector3d along = speed_m_s > kStill_m_s ? Vector3d(sliding_m_s / speed_m_s) : Vector3d::UnitX();
    contact.fdir1[0] = along.x();
    contact.fdir1[1] = along.y();
    dJointAttach(dJointCreateContact(world, contact_joints, &contact), dGeomGetBody(each.geom.g1),
                 dGeomGetBody(each.geom.g2));
  }
}

std::string Plant::World::TouchProblem() const {
  if (contacts.empty()) return {};
  const auto touch = [this](const Contact& contact) {
    return fmt::format("'{}' touches the ground at ({:.2f}, {:.2f}) m", model.shapes[contact.shape].link,
                       contact.geom.pos[0], contact.geom.pos[1]);
  };
  if (!options.touch_down_max_m_s)
    return fmt::format("{} with {:.2f} m/s", touch(contacts.front()), base.Velocity().norm());
  const double limit_m_s = *options.touch_down_max_m_s;
  for (const Contact& contact : contacts)
    if (const double speed_m_s = -PointVelocity(contact.geom).z(); speed_m_s > limit_m_s)
      return fmt::format("{} with {:.3f} m/s, limit {:g} m/s", touch(contact), speed_m_s, limit_m_s);
  const double upright = dBodyGetRotation(base.id)[10];
  if (upright < std::cos(kTouchTiltMax_rad))
    return fmt::format("{} tilted by {:.1f} deg, limit {:.0f} deg", touch(contacts.front()),
                       std::acos(upright) * 180 / std::numbers::pi,
                       kTouchTiltMax_rad * 180 / std::numbers::pi);
  return {};
}

double Plant::World::Clearance_m() const {
  double lowest_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const dReal* r = dGeomGetRotation(shapes[i].geom);
    const double below_m = ExtentBelow(model.shapes[i], {r[8], r[9], r[10]});
    lowest_m = std::min(lowest_m, dGeomGetPosition(shapes[i].geom)[2] - below_m);
  }
  return lowest_m;
}

}  // namespace tiltproof::plant
