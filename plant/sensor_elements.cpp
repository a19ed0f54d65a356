#include "plant/sensor_elements.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <functional>
#include <ignition/math/Pose3.hh>
#include <initializer_list>
#include <map>
#include <optional>
#include <sdf/AirPressure.hh>
#include <sdf/Imu.hh>
#include <sdf/Joint.hh>
#include <sdf/Link.hh>
#include <sdf/Magnetometer.hh>
#include <sdf/NavSat.hh>
#include <sdf/Noise.hh>
#include <sdf/Sensor.hh>
#include <set>

#include "plant/sdf_file.h"

namespace tiltproof::plant {
namespace {

using ignition::math::Pose3d;
using tinyxml2::XMLElement;

struct TypeName {
  std::string_view name;
  SensorKind kind;
};
constexpr std::array<TypeName, 5> kTypes = {{{"imu", SensorKind::kImu},
                                             {"magnetometer", SensorKind::kMagnetometer},
                                             {"air_pressure", SensorKind::kAirPressure},
                                             {"navsat", SensorKind::kGnss},
                                             {"gps", SensorKind::kGnss}}};

std::optional<SensorKind> KindOf(std::string_view type) {
  for (const TypeName& each : kTypes)
    if (each.name == type) return each.kind;
  return std::nullopt;
}

// Elements of a sensor that hold numbers, and their range.
struct NumberElement {
  std::string_view name;
  double min, max;
  int count = 1;
};
constexpr double kAny = 1e9;
constexpr std::array<NumberElement, 10> kNumbers = {{{"update_rate", 0, 1e6},
                                                     {"pose", -kAny, kAny, 6},
                                                     {"reference_altitude", -1000, 18000},
                                                     {"mean", -kAny, kAny},
                                                     {"stddev", 0, kAny},
                                                     {"bias_mean", -kAny, kAny},
                                                     {"bias_stddev", 0, kAny},
                                                     {"dynamic_bias_stddev", 0, kAny},
                                                     {"dynamic_bias_correlation_time", 0, kAny},
                                                     {"precision", 0, kAny}}};

bool IsNumber(std::string_view text, double min, double max) {
  double value = 0;
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && rest == text.data() + text.size() && value >= min && value <= max;
}

void CheckNumber(const std::filesystem::path& file, const XMLElement& element, const std::string& sensor,
                 std::vector<VehicleProblem>& problems) {
  const auto known = std::find_if(kNumbers.begin(), kNumbers.end(),
                                  [&](const NumberElement& each) { return each.name == element.Name(); });
  if (known == kNumbers.end()) return;
  const std::string text = element.GetText() == nullptr ? "" : element.GetText();
  constexpr std::string_view kBlank = " \t\r\n";
  int count = 0;
  bool in_order = true;
  for (std::size_t at = text.find_first_not_of(kBlank); at != std::string::npos; ++count) {
    const std::size_t end = std::min(text.find_first_of(kBlank, at), text.size());
    in_order = in_order && IsNumber(std::string_view(text).substr(at, end - at), known->min, known->max);
    at = text.find_first_not_of(kBlank, end);
  }
  const int wanted_count = element.Attribute("rotation_format", "quat_xyzw") != nullptr ? 7 : known->count;
  // An empty pose is no pose.
  if (in_order && (count == wanted_count || (count == 0 && known->name == "pose"))) return;
  const std::string wanted = known->count == 6   ? "six numbers"
                             : known->max < kAny ? fmt::format("a number in [{}, {}]", known->min, known->max)
                             : known->min == 0   ? std::string("a number that is not negative")
                                                 : std::string("a number");
  problems.push_back(
      {file, element.GetLineNum(),
       fmt::format("sensor '{}': <{}> must be {}, is '{}'", sensor, known->name, wanted, text)});
}

void CheckNumbersIn(const std::filesystem::path& file, const XMLElement& parent, const std::string& sensor,
                    std::vector<VehicleProblem>& problems) {
  for (const auto* child = parent.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    if (std::string_view(child->Name()) == "plugin") continue;
    CheckNumber(file, *child, sensor, problems);
    CheckNumbersIn(file, *child, sensor, problems);
  }
}

SensorNoise ToNoise(const sdf::Noise& from) {
  if (from.Type() == sdf::NoiseType::NONE) return {};
  return {.mean = from.Mean(),
          .stddev = from.StdDev(),
          .bias_mean = from.BiasMean(),
          .bias_stddev = from.BiasStdDev(),
          .walk_density = from.DynamicBiasStdDev(),
          .walk_time_s = from.DynamicBiasCorrelationTime(),
          .quantum = from.Type() == sdf::NoiseType::GAUSSIAN_QUANTIZED ? from.Precision() : 0};
}

// In the order of the kind's signals.
std::vector<SensorNoise> NoiseOf(const sdf::Sensor& sensor, SensorKind kind) {
  std::vector<SensorNoise> noise;
  const auto add = [&noise](std::initializer_list<std::reference_wrapper<const sdf::Noise>> all) {
    for (const sdf::Noise& each : all) noise.push_back(ToNoise(each));
  };
  if (const auto* imu = sensor.ImuSensor(); imu != nullptr && kind == SensorKind::kImu)
    add({imu->LinearAccelerationXNoise(), imu->LinearAccelerationYNoise(), imu->LinearAccelerationZNoise(),
         imu->AngularVelocityXNoise(), imu->AngularVelocityYNoise(), imu->AngularVelocityZNoise()});
  if (const auto* mag = sensor.MagnetometerSensor(); mag != nullptr && kind == SensorKind::kMagnetometer)
    add({mag->XNoise(), mag->YNoise(), mag->ZNoise()});
  if (const auto* air = sensor.AirPressureSensor(); air != nullptr && kind == SensorKind::kAirPressure)
    add({air->PressureNoise()});
  if (const auto* gnss = sensor.NavSatSensor(); gnss != nullptr && kind == SensorKind::kGnss)
    add({gnss->HorizontalPositionNoise(), gnss->HorizontalPositionNoise(), gnss->VerticalPositionNoise(),
         gnss->HorizontalVelocityNoise(), gnss->HorizontalVelocityNoise(), gnss->VerticalVelocityNoise()});
  noise.resize(SignalCount(kind));
  return noise;
}

// Names of links and joints are those of the files: `a::b` in nested models.
class SensorReader {
 public:
  SensorReader(const SdfFiles& files, const VehicleElements& elements, const VehicleModel& vehicle,
               std::vector<std::string>& warnings, std::vector<VehicleProblem>& problems)
      : files_(files), elements_(elements), vehicle_(vehicle), warnings_(warnings), problems_(problems) {}

  std::vector<Sensor> Read(const sdf::Model& flat);

 private:
  struct Place {
    const sdf::Link* link;
    Pose3d pose;  // in the frame of the whole model
  };
  struct Connection {
    std::string joint, a, b;
  };

  void Walk(const sdf::Model& flat);
  // Links that no hinge separates from the base.
  std::set<std::string> RigidLinks() const;
  void ReadSensor(const sdf::Sensor& sensor, SensorKind kind, const std::string& link, const Place& place);
  void WarnOfNoise(const Sensor& sensor, const SdfPlace& where);
  void ApplyElements();
  SdfPlace WhereIs(const std::string& link, const std::string& sensor) const;

  const SdfFiles& files_;
  const VehicleElements& elements_;
  const VehicleModel& vehicle_;
  std::vector<std::string>& warnings_;
  std::vector<VehicleProblem>& problems_;
  std::vector<std::string> order_;  // the names of the links
  std::map<std::string, Place> links_;
  std::vector<Connection> connections_;
  std::vector<Sensor> sensors_;
};

void SensorReader::Walk(const sdf::Model& flat) {
  for (std::uint64_t i = 0; i < flat.LinkCount(); ++i) {
    const sdf::Link& link = *flat.LinkByIndex(i);
    Pose3d pose;
    // One that cannot be resolved is an error of the loader.
    if (!link.SemanticPose().Resolve(pose).empty()) continue;
    order_.push_back(OuterName(link.Name()));
    links_.insert_or_assign(order_.back(), Place{&link, pose});
  }
  for (std::uint64_t i = 0; i < flat.JointCount(); ++i) {
    const sdf::Joint& joint = *flat.JointByIndex(i);
    connections_.push_back(
        {OuterName(joint.Name()), OuterName(joint.ParentLinkName()), OuterName(joint.ChildLinkName())});
  }
}

std::set<std::string> SensorReader::RigidLinks() const {
  const auto is_hinge = [this](const std::string& joint) {
    return std::any_of(vehicle_.hinges.begin(), vehicle_.hinges.end(),
                       [&joint](const Hinge& hinge) { return hinge.joint == joint; });
  };
  std::set<std::string> rigid = {elements_.base_link};
  for (bool grows = true; grows;) {
    grows = false;
    for (const Connection& each : connections_) {
      if (is_hinge(each.joint) || rigid.contains(each.a) == rigid.contains(each.b)) continue;
      rigid.insert({each.a, each.b});
      grows = true;
    }
  }
  return rigid;
}

SdfPlace SensorReader::WhereIs(const std::string& link, const std::string& sensor) const {
  const SdfPart* part = files_.Link(link);
  if (part == nullptr) return {files_.file(), 0};
  for (const auto* e = part->element->FirstChildElement("sensor"); e != nullptr;
       e = e->NextSiblingElement("sensor"))
    if (AttributeOf(*e, "name") == sensor) return {part->file(), e->GetLineNum()};
  return {part->file(), part->line()};
}

std::vector<Sensor> SensorReader::Read(const sdf::Model& flat) {
  Walk(flat);
  if (!links_.contains(elements_.base_link)) return {};
  const std::set<std::string> rigid = RigidLinks();
  for (const std::string& name : order_) {
    const Place& place = links_.at(name);
    for (std::uint64_t i = 0; i < place.link->SensorCount(); ++i) {
      const sdf::Sensor& sensor = *place.link->SensorByIndex(i);
      const std::optional<SensorKind> kind = KindOf(sensor.TypeStr());
      if (!kind) continue;
      if (rigid.contains(name)) {
        ReadSensor(sensor, *kind, name, place);
      } else {
        const SdfPlace where = WhereIs(name, sensor.Name());
        warnings_.push_back(
            fmt::format("{}:{}: <sensor name=\"{}\">: ignored: link '{}' moves against the base; put the "
                        "sensor on a link "
                        "that is fixed to it",
                        where.file.string(), where.line, sensor.Name(), name));
      }
    }
  }
  ApplyElements();
  return std::move(sensors_);
}

void SensorReader::ReadSensor(const sdf::Sensor& from, SensorKind kind, const std::string& link,
                              const Place& place) {
  const SdfPlace where = WhereIs(link, from.Name());
  const std::size_t scope = link.rfind("::");
  const std::string name = (scope == std::string::npos ? "" : link.substr(0, scope + 2)) + from.Name();
  const auto complain = [&](std::string message) {
    problems_.push_back({where.file, where.line, std::move(message)});
  };
  if (std::any_of(sensors_.begin(), sensors_.end(),
                  [&name](const Sensor& other) { return other.name == name; }))
    complain(fmt::format("a second sensor '{}': rename one of them", name));
  Pose3d in_link;
  if (const sdf::Errors errors = from.SemanticPose().Resolve(in_link); !errors.empty()) {
    complain(fmt::format("sensor '{}': {}", name, errors.front().Message()));
    return;
  }
  const Pose3d pose = links_.at(elements_.base_link).pose.Inverse() * place.pose * in_link;
  const ignition::math::Matrix3d turn(pose.Rot());
  Sensor sensor{.kind = kind, .name = name};
  sensor.p_BS_m = {pose.Pos().X(), pose.Pos().Y(), pose.Pos().Z()};
  for (Eigen::Index row = 0; row < 3; ++row)
    for (Eigen::Index column = 0; column < 3; ++column)
      sensor.R_BS(row, column) = turn(static_cast<std::size_t>(row), static_cast<std::size_t>(column));
  sensor.rate_hz = from.UpdateRate();
  if (const auto* air = from.AirPressureSensor()) sensor.altitude_m = air->ReferenceAltitude();
  sensor.noise = NoiseOf(from, kind);
  WarnOfNoise(sensor, where);
  sensors_.push_back(std::move(sensor));
  const SignalTable signals = SensorSignals(sensors_);
  for (std::size_t i = signals.size() - SignalCount(kind); i < signals.size(); ++i)
    if (signals.Find(signals[i].name) != i) {
      complain(fmt::format("two sensors have the signal '{}': rename one of them", signals[i].name));
      return;
    }
}

// Some files state it in gauss, as the sensors of Gazebo 8 read.
void SensorReader::WarnOfNoise(const Sensor& sensor, const SdfPlace& where) {
  const double field_t = elements_.surroundings.magnetic_field_t.norm();
  if (sensor.kind != SensorKind::kMagnetometer) return;
  for (const SensorNoise& noise : sensor.noise) {
    if (noise.stddev <= field_t) continue;
    warnings_.push_back(fmt::format(
        "{}:{}: sensor '{}': a noise of {:.3g} T is larger than the field, {:.3g} T; 1 gauss is 1e-4 T",
        where.file.string(), where.line, sensor.name, noise.stddev, field_t));
    return;
  }
}

// Adds the part that SDF lacks: <tiltproof:sensor>.
void SensorReader::ApplyElements() {
  std::vector<std::string> names;
  for (const Sensor& sensor : sensors_) names.push_back(sensor.name);
  for (const SensorElement& element : elements_.sensors) {
    const auto found = std::find(names.begin(), names.end(), element.name);
    if (found != names.end()) {
      sensors_[static_cast<std::size_t>(found - names.begin())].latency_s = element.latency_s;
    } else if (!element.name.empty()) {
      problems_.push_back(
          {elements_.file, element.line,
           names.empty()
               ? fmt::format("<tiltproof:sensor>: the vehicle has no sensor '{}'; it has none", element.name)
               : fmt::format("<tiltproof:sensor>: the vehicle has no sensor '{}'; it has {}", element.name,
                             fmt::join(names, ", "))});
    }
  }
}

}  // namespace

bool IsSensorType(std::string_view type) { return KindOf(type).has_value(); }

void CheckSensorNumbers(const SdfFiles& files, std::vector<VehicleProblem>& problems) {
  for (const SdfPart& link : files.links())
    for (const auto* e = link.element->FirstChildElement("sensor"); e != nullptr;
         e = e->NextSiblingElement("sensor"))
      if (IsSensorType(AttributeOf(*e, "type")))
        CheckNumbersIn(link.file(), *e, AttributeOf(*e, "name"), problems);
}

std::vector<Sensor> ReadSensors(const sdf::Model& flat, const SdfFiles& files,
                                const VehicleElements& elements, const VehicleModel& vehicle,
                                std::vector<std::string>& warnings, std::vector<VehicleProblem>& problems) {
  return SensorReader(files, elements, vehicle, warnings, problems).Read(flat);
}

}  // namespace tiltproof::plant
