#include "harness/export/flight_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "harness/report/json_fields.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

using Vector = std::array<double, 3>;
// A quaternion of unit length.
struct Quaternion {
  double x, y, z, w;
};

Vector Plus(const Vector& a, const Vector& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
Vector Minus(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Vector Cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Turns by b first, then by a.
Quaternion operator*(const Quaternion& a, const Quaternion& b) {
  return {a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
          a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
}
// Turns about a unit axis.
Quaternion Turn(const Vector& axis, double angle_rad) {
  const double half = std::sin(angle_rad / 2);
  return {axis[0] * half, axis[1] * half, axis[2] * half, std::cos(angle_rad / 2)};
}
// The shortest turn of the z axis to this unit vector.
Quaternion TurnOfZTo(const Vector& to) {
  const double w = 1 + to[2];
  if (w < 1e-12) return {1, 0, 0, 0};
  const double length = std::sqrt(w * w + to[0] * to[0] + to[1] * to[1]);
  return {-to[1] / length, to[0] / length, 0, w / length};
}
Vector Turned(const Quaternion& q, const Vector& v) {
  const Vector axis = {q.x, q.y, q.z};
  const Vector twice = Cross(axis, v);
  const Vector sideways = {2 * twice[0], 2 * twice[1], 2 * twice[2]};
  const Vector back = Cross(axis, sideways);
  return {v[0] + q.w * sideways[0] + back[0], v[1] + q.w * sideways[1] + back[1],
          v[2] + q.w * sideways[2] + back[2]};
}

constexpr const char* kWorld = "world";
constexpr const char* kBody = "body";
// A path has no more points than that: the others are left out evenly.
constexpr std::size_t kPathPointsMax = 2'000;

struct Rgba {
  double r, g, b, a = 1;
};
constexpr Rgba kBodyColor{0.45, 0.5, 0.55}, kNoseColor{0.9, 0.6, 0}, kRotorColor{0.1, 0.45, 0.7, 0.6},
    kPathColor{0.55, 0.55, 0.55};

std::string RotorFrame(const RotorShape& rotor) { return "rotor_" + rotor.name; }
Vector VectorOf(const std::vector<double>& numbers) { return {numbers.at(0), numbers.at(1), numbers.at(2)}; }

// Its parts are finite, and so all of it is JSON.
std::string Transform(TimeNs time_ns, const std::string& parent, const std::string& child, const Vector& p,
                      const Quaternion& q) {
  return fmt::format(R"({{"timestamp":{{"sec":{},"nsec":{}}},"parent_frame_id":{},"child_frame_id":{},)"
                     R"("translation":{{"x":{},"y":{},"z":{}}},"rotation":{{"x":{},"y":{},"z":{},"w":{}}}}})",
                     time_ns / kNsPerS, time_ns % kNsPerS, JsonText(parent), JsonText(child), p[0], p[1],
                     p[2], q.x, q.y, q.z, q.w);
}

Json PointJson(const Vector& v) { return {{"x", v[0]}, {"y", v[1]}, {"z", v[2]}}; }
Json ColorJson(const Rgba& color) { return {{"r", color.r}, {"g", color.g}, {"b", color.b}, {"a", color.a}}; }
Json PoseJson(const Vector& p) {
  return {{"position", PointJson(p)}, {"orientation", {{"x", 0.0}, {"y", 0.0}, {"z", 0.0}, {"w", 1.0}}}};
}
Json LineJson(int type, double thickness, bool in_pixels, const std::vector<Vector>& points,
              const Rgba& color) {
  Json list = Json::array();
  for (const Vector& point : points) list.push_back(PointJson(point));
  return {{"type", type},
          {"pose", PoseJson({0, 0, 0})},
          {"thickness", thickness},
          {"scale_invariant", in_pixels},
          {"points", list},
          {"color", ColorJson(color)},
          {"colors", Json::array()},
          {"indices", Json::array()}};
}
constexpr int kLineStrip = 0, kLineList = 2;

// It stays for the whole flight, and moves with its frame.
Json EntityJson(const std::string& id, const std::string& frame) {
  Json entity = {{"timestamp", {{"sec", 0}, {"nsec", 0}}},
                 {"frame_id", frame},
                 {"id", id},
                 {"lifetime", {{"sec", 0}, {"nsec", 0}}},
                 {"frame_locked", true}};
  for (const char* list :
       {"metadata", "arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models"})
    entity[list] = Json::array();
  return entity;
}

std::vector<Vector> PathPoints(const Trace& trace) {
  const auto x = trace.Find("x_ref_m"), y = trace.Find("y_ref_m"), z = trace.Find("z_ref_m");
  std::vector<Vector> points;
  if (!x || !y || !z) return points;
  for (std::size_t r = 0; r < trace.row_count(); ++r) {
    const Vector point = {trace.at(r, *x), trace.at(r, *y), trace.at(r, *z)};
    if (std::ranges::all_of(point, [](double value) { return std::isfinite(value); }) &&
        (points.empty() || point != points.back()))
      points.push_back(point);
  }
  const std::size_t step = (points.size() + kPathPointsMax - 1) / kPathPointsMax;
  if (step <= 1) return points;
  std::vector<Vector> fewer;
  for (std::size_t i = 0; i < points.size(); i += step) fewer.push_back(points[i]);
  fewer.back() = points.back();
  return fewer;
}

void AddVehicle(const VehicleShape& vehicle, Json& entities) {
  const Vector size = VectorOf(vehicle.body_size_m), centre = VectorOf(vehicle.body_position_m);
  Json body = EntityJson(kBody, kBody);
  body["cubes"].push_back(
      {{"pose", PoseJson(centre)}, {"size", PointJson(size)}, {"color", ColorJson(kBodyColor)}});
  const Vector front = Plus(centre, {size[0] / 2, 0, 0});
  const double nose_m = *std::ranges::min_element(size) / 2;
  body["spheres"].push_back({{"pose", PoseJson(front)},
                             {"size", PointJson({nose_m, nose_m, nose_m})},
                             {"color", ColorJson(kNoseColor)}});
  double reach_m = 0.2;
  std::vector<Vector> arms;
  for (const RotorShape& rotor : vehicle.rotors) {
    const Vector p = VectorOf(rotor.position_m);
    reach_m = std::max(reach_m, std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]));
    arms.insert(arms.end(), {centre, VectorOf(rotor.hinge_point_m)});
  }
  if (!arms.empty()) body["lines"].push_back(LineJson(kLineList, reach_m * 0.04, false, arms, kBodyColor));
  entities.push_back(body);
  for (const RotorShape& rotor : vehicle.rotors) {
    Json entity = EntityJson(RotorFrame(rotor), RotorFrame(rotor));
    entity["cylinders"].push_back({{"pose", PoseJson({0, 0, reach_m * 0.08})},
                                   {"size", PointJson({reach_m * 0.84, reach_m * 0.84, reach_m * 0.03})},
                                   {"bottom_scale", 1.0},
                                   {"top_scale", 1.0},
                                   {"color", ColorJson(kRotorColor)}});
    entities.push_back(entity);
  }
}

}  // namespace

FlightScene::FlightScene(const Trace& trace, const std::optional<VehicleShape>& vehicle)
    : trace_(trace), vehicle_(vehicle) {
  constexpr std::array kPose = {"x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad"};
  pose_.emplace();
  for (std::size_t i = 0; i < kPose.size(); ++i) {
    const auto column = trace.Find(kPose[i]);
    if (!column) {
      pose_.reset();
      break;
    }
    (*pose_)[i] = *column;
  }
  if (!vehicle) return;
  for (const RotorShape& rotor : vehicle->rotors) angles_.push_back(trace.Find(rotor.angle));
}

std::vector<std::string> FlightScene::Transforms(TimeNs time_ns, std::span<const double> row) const {
  std::vector<std::string> transforms;
  if (!pose_ || time_ns < 0) return transforms;
  const auto at = [&](std::size_t i) {
    CheckIndex((*pose_)[i], row.size(), "a row has each column of its trace");
    return row[(*pose_)[i]];
  };
  for (std::size_t i = 0; i < pose_->size(); ++i)
    if (!std::isfinite(at(i))) return transforms;
  // Z-Y-X Euler angles, as everywhere (ARCHITECTURE.md, "Frames and symbols").
  const Quaternion q_WB = Turn({0, 0, 1}, at(5)) * Turn({0, 1, 0}, at(4)) * Turn({1, 0, 0}, at(3));
  transforms.push_back(Transform(time_ns, kWorld, kBody, {at(0), at(1), at(2)}, q_WB));
  if (!vehicle_) return transforms;
  Check(angles_.size() == vehicle_->rotors.size(), "a scene has an angle for each rotor");
  for (std::size_t i = 0; i < vehicle_->rotors.size(); ++i) {
    const RotorShape& rotor = vehicle_->rotors[i];
    const double angle_rad = angles_[i] ? row[*angles_[i]] : 0.0;
    if (!std::isfinite(angle_rad)) continue;
    const Quaternion tilt = Turn(VectorOf(rotor.hinge_axis), angle_rad);
    const Vector hinge = VectorOf(rotor.hinge_point_m);
    const Vector centre = Plus(hinge, Turned(tilt, Minus(VectorOf(rotor.position_m), hinge)));
    transforms.push_back(
        Transform(time_ns, kBody, RotorFrame(rotor), centre, tilt * TurnOfZTo(VectorOf(rotor.thrust_axis))));
  }
  return transforms;
}

std::string FlightScene::Update() const {
  Json entities = Json::array();
  if (const auto path = PathPoints(trace_); path.size() > 1) {
    Json entity = EntityJson("reference", kWorld);
    entity["lines"].push_back(LineJson(kLineStrip, 2, true, path, kPathColor));
    entities.push_back(entity);
  }
  if (vehicle_) AddVehicle(*vehicle_, entities);
  return JsonText(Json{{"deletions", Json::array()}, {"entities", entities}});
}

}  // namespace tiltproof::harness
