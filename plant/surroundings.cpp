#include "plant/surroundings.h"

#include <cmath>
#include <numbers>

namespace tiltproof::plant {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kRadPerDeg = std::numbers::pi / 180;

// WGS 84: semi-major axis, flattening, square of the eccentricity.
constexpr double kMajor_m = 6378137.0, kFlattening = 1 / 298.257223563;
constexpr double kEccentricity2 = kFlattening * (2 - kFlattening);

// Columns: east, north, up in the Earth's frame.
Matrix3d AxesAt(double latitude_rad, double longitude_rad) {
  const double sin_lat = std::sin(latitude_rad), cos_lat = std::cos(latitude_rad);
  const double sin_lon = std::sin(longitude_rad), cos_lon = std::cos(longitude_rad);
  Matrix3d axes;
  axes << -sin_lon, -sin_lat * cos_lon, cos_lat * cos_lon,  //
      cos_lon, -sin_lat * sin_lon, cos_lat * sin_lon,       //
      0, cos_lat, sin_lat;
  return axes;
}

// Radius of curvature in the prime vertical.
double PrimeVertical_m(double sin_latitude) {
  return kMajor_m / std::sqrt(1 - kEccentricity2 * sin_latitude * sin_latitude);
}

}  // namespace

double StandardPressure_pa(double altitude_m) {
  constexpr double kSeaLevel_pa = 101325, kSeaLevel_k = 288.15, kLapse_k_m = 0.0065, kTropopause_m = 11000;
  constexpr double kEarthRadius_m = 6356766;
  // g0 M / R*, in K/m.
  constexpr double kHydrostatic_k_m = 9.80665 * 0.0289644 / 8.31432;
  const double geopotential_m = kEarthRadius_m * altitude_m / (kEarthRadius_m + altitude_m);
  const auto troposphere_pa = [&](double height_m) {
    return kSeaLevel_pa * std::pow(1 - kLapse_k_m * height_m / kSeaLevel_k, kHydrostatic_k_m / kLapse_k_m);
  };
  if (geopotential_m <= kTropopause_m) return troposphere_pa(geopotential_m);
  constexpr double kTropopause_k = kSeaLevel_k - kLapse_k_m * kTropopause_m;
  return troposphere_pa(kTropopause_m) *
         std::exp(-kHydrostatic_k_m * (geopotential_m - kTropopause_m) / kTropopause_k);
}

EarthFrame::EarthFrame(const Surroundings& surroundings) {
  const double latitude_rad = surroundings.latitude_deg * kRadPerDeg,
               longitude_rad = surroundings.longitude_deg * kRadPerDeg;
  R_EW_ = AxesAt(latitude_rad, longitude_rad);
  const double radius_m = PrimeVertical_m(std::sin(latitude_rad)), height_m = surroundings.elevation_m;
  const Vector3d up = R_EW_.col(2);
  origin_m_ = {(radius_m + height_m) * up.x(), (radius_m + height_m) * up.y(),
               (radius_m * (1 - kEccentricity2) + height_m) * up.z()};
}

// Bowring, "Transformation from spatial to geographical coordinates", Survey Review 23(181), 1976, applied twice.
GeographicPoint EarthFrame::CoordinatesOf(const Vector3d& p_m) const {
  const Vector3d p_E = origin_m_ + R_EW_ * p_m;
  const double from_axis_m = std::hypot(p_E.x(), p_E.y());
  constexpr double kMinor_m = kMajor_m * (1 - kFlattening);
  double latitude_rad = 0, reduced_rad = std::atan2(p_E.z() * kMajor_m, from_axis_m * kMinor_m);
  for (int i = 0; i < 2; ++i) {
    const double sine = std::sin(reduced_rad), cosine = std::cos(reduced_rad);
    latitude_rad = std::atan2(p_E.z() + kEccentricity2 / (1 - kEccentricity2) * kMinor_m * sine * sine * sine,
                              from_axis_m - kEccentricity2 * kMajor_m * cosine * cosine * cosine);
    reduced_rad = std::atan2((1 - kFlattening) * std::sin(latitude_rad), std::cos(latitude_rad));
  }
  const double sine = std::sin(latitude_rad), cosine = std::cos(latitude_rad);
  const double radius_m = PrimeVertical_m(sine);
  const double altitude_m = from_axis_m * cosine + p_E.z() * sine - kMajor_m * kMajor_m / radius_m;
  const double meridian_m =
      radius_m * (1 - kEccentricity2) / (1 - kEccentricity2 * sine * sine);  // radius of curvature
  return {.latitude_deg = latitude_rad / kRadPerDeg,
          .longitude_deg = std::atan2(p_E.y(), p_E.x()) / kRadPerDeg,
          .altitude_m = altitude_m,
          .north_m_per_deg = (meridian_m + altitude_m) * kRadPerDeg,
          .east_m_per_deg = (radius_m + altitude_m) * cosine * kRadPerDeg};
}

Vector3d EarthFrame::NorthEastDown(const Vector3d& v_m_s, const GeographicPoint& at) const {
  const Vector3d enu =
      AxesAt(at.latitude_deg * kRadPerDeg, at.longitude_deg * kRadPerDeg).transpose() * (R_EW_ * v_m_s);
  return {enu.y(), enu.x(), -enu.z()};
}

}  // namespace tiltproof::plant
