// The place on Earth above which the vehicle flies: magnetic field, air pressure, and geographic coordinates.
//
//   const EarthFrame earth({.latitude_deg = 47.4, .longitude_deg = 8.5, .elevation_m = 488});
//   earth.CoordinatesOf({0, 100, 20}).latitude_deg;  // 100 m north and 20 m above the world's origin
//   StandardPressure_pa(488);                        // 95598
//
// The world's axes are east, north and up (x, y, z) at its origin: SDF's default.
#pragma once

#include <Eigen/Core>

namespace tiltproof::plant {

// `<tiltproof:world>` of the vehicle's file states others. The place is that of PX4's simulated flights. The field is
// SDF's default.
struct Surroundings {
  Eigen::Vector3d magnetic_field_t = {5.5645e-6, 22.8758e-6, -42.3884e-6};         // the world's axes
  double latitude_deg = 47.397742, longitude_deg = 8.545594, elevation_m = 488.0;  // of the world's origin
};

// Pressure of the air at an altitude above sea level (m), up to 20 km. Source: U.S. Standard Atmosphere, 1976,
// equations 18 (geopotential altitude), 33a and 33b.
double StandardPressure_pa(double altitude_m);

// Geographic coordinates.
struct GeographicPoint {
  double latitude_deg = 0, longitude_deg = 0, altitude_m = 0;  // above the ellipsoid
  // Lengths of one degree of latitude and of longitude there.
  double north_m_per_deg = 0, east_m_per_deg = 0;
};

// The tangent plane of the WGS 84 ellipsoid at the world's origin. Source: NIMA TR8350.2, Department of Defense World
// Geodetic System 1984, 3rd ed., 2000.
class EarthFrame {
 public:
  explicit EarthFrame(const Surroundings& surroundings);
  // GeographicPoint of a point, correct to 1e-6 m up to 1000 km from the origin.
  GeographicPoint CoordinatesOf(const Eigen::Vector3d& p_m) const;
  // A velocity of the world's axes as north, east and down at the place with these coordinates.
  Eigen::Vector3d NorthEastDown(const Eigen::Vector3d& v_m_s, const GeographicPoint& at) const;

 private:
  Eigen::Vector3d origin_m_;  // Earth-centred, Earth-fixed
  Eigen::Matrix3d R_EW_;      // columns: the world's axes in that frame
};

}  // namespace tiltproof::plant
