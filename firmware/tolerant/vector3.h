// Vectors and rotations in binary32 for the firmware's model of the vehicle: the few operations it needs.
//
//   const Vector3 force_W = R_WB * force_B;       // into the world's axes
//   const Vector3 rate_B = Transposed(R_WB, rate_W);
#pragma once

namespace tiltproof::firmware {

struct Vector3 {
  float x = 0, y = 0, z = 0;
  friend bool operator==(const Vector3&, const Vector3&) = default;
};

constexpr Vector3 operator+(const Vector3& a, const Vector3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
constexpr Vector3 operator-(const Vector3& a, const Vector3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
constexpr Vector3 operator*(float factor, const Vector3& a) {
  return {factor * a.x, factor * a.y, factor * a.z};
}
constexpr float Dot(const Vector3& a, const Vector3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
constexpr Vector3 Cross(const Vector3& a, const Vector3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// Its columns; of a rotation R_WB the axes of B in W.
struct Matrix3 {
  Vector3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  friend bool operator==(const Matrix3&, const Matrix3&) = default;
};

constexpr Vector3 operator*(const Matrix3& m, const Vector3& a) { return a.x * m.x + a.y * m.y + a.z * m.z; }
// The transpose of m, times a.
constexpr Vector3 Transposed(const Matrix3& m, const Vector3& a) {
  return {Dot(m.x, a), Dot(m.y, a), Dot(m.z, a)};
}

// A symmetric matrix.
struct Symmetric3 {
  float xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0;
};

constexpr Symmetric3 operator+(const Symmetric3& a, const Symmetric3& b) {
  return {a.xx + b.xx, a.yy + b.yy, a.zz + b.zz, a.xy + b.xy, a.xz + b.xz, a.yz + b.yz};
}
constexpr Vector3 operator*(const Symmetric3& m, const Vector3& a) {
  return {m.xx * a.x + m.xy * a.y + m.xz * a.z, m.xy * a.x + m.yy * a.y + m.yz * a.z,
          m.xz * a.x + m.yz * a.y + m.zz * a.z};
}

// b with m b = a, for a positive definite m.
constexpr Vector3 Solve(const Symmetric3& m, const Vector3& a) {
  const Symmetric3 adjugate = {m.yy * m.zz - m.yz * m.yz, m.xx * m.zz - m.xz * m.xz,
                               m.xx * m.yy - m.xy * m.xy, m.xz * m.yz - m.xy * m.zz,
                               m.xy * m.yz - m.xz * m.yy, m.xy * m.xz - m.xx * m.yz};
  const float determinant = m.xx * adjugate.xx + m.xy * adjugate.xy + m.xz * adjugate.xz;
  return (1 / determinant) * (adjugate * a);
}

}  // namespace tiltproof::firmware
