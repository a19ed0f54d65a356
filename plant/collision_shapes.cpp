#include "plant/collision_shapes.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <sdf/Box.hh>
#include <sdf/Collision.hh>
#include <sdf/Cylinder.hh>
#include <sdf/Geometry.hh>
#include <sdf/Sphere.hh>

namespace tiltproof::plant {
namespace {

// Fills in kind and size. Returns false for a shape that has no effect.
bool ReadGeometry(const sdf::Geometry& geometry, CollisionShape& shape) {
  if (const sdf::Box* box = geometry.BoxShape(); box != nullptr) {
    shape.kind = CollisionShape::Kind::kBox;
    shape.size_m = {box->Size().X(), box->Size().Y(), box->Size().Z()};
  } else if (const sdf::Sphere* sphere = geometry.SphereShape(); sphere != nullptr) {
    shape.kind = CollisionShape::Kind::kSphere;
    shape.size_m = {sphere->Radius(), 0, 0};
  } else if (const sdf::Cylinder* cylinder = geometry.CylinderShape(); cylinder != nullptr) {
    shape.kind = CollisionShape::Kind::kCylinder;
    shape.size_m = {cylinder->Radius(), cylinder->Length(), 0};
  } else {
    return false;
  }
  return true;
}

}  // namespace

std::string AddShapes(const sdf::Link& link, const std::string& body, const CollisionShape& as,
                      std::vector<CollisionShape>& shapes) {
  for (std::uint64_t i = 0; i < link.CollisionCount(); ++i) {
    const sdf::Collision& collision = *link.CollisionByIndex(i);
    CollisionShape shape = as;
    if (!ReadGeometry(*collision.Geom(), shape)) continue;
    ignition::math::Pose3d pose;
    if (const sdf::Errors errors = collision.SemanticPose().Resolve(pose, body); !errors.empty())
      return "collision '" + collision.Name() + "': " + errors.front().Message();
    shape.p_LS_m = {pose.Pos().X(), pose.Pos().Y(), pose.Pos().Z()};
    const ignition::math::Matrix3d turn(pose.Rot());
    for (std::size_t row = 0; row < 3; ++row)
      for (std::size_t column = 0; column < 3; ++column)
        shape.R_LS(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) = turn(row, column);
    shapes.push_back(std::move(shape));
  }
  return {};
}

// I_1 = m (b^2 + c^2) / 12 and so on, solved for the edges a, b, c of a box along the principal axes.
CollisionShape InertiaBox(const RigidBody& base) {
  CollisionShape shape;
  shape.link = base.link;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(base.inertia_kg_m2);
  const Eigen::Vector3d& moments = principal.eigenvalues();
  constexpr double kEdgeMin_m = 0.01;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double edge_squared = 6 * (moments.sum() - 2 * moments[i]) / base.mass_kg;
    shape.size_m[i] = std::sqrt(std::max(edge_squared, kEdgeMin_m * kEdgeMin_m));
  }
  shape.p_LS_m = base.p_com_m;
  shape.R_LS = principal.eigenvectors();
  if (shape.R_LS.determinant() < 0) shape.R_LS.col(0) *= -1;
  return shape;
}

}  // namespace tiltproof::plant
