// Sine, cosine and arc tangent in binary32 without the C library, so that every port computes the same bits in
// a bounded time.
//
//   const SineCosine yaw = ComputeSineCosine(yaw_rad);
//   const float back_rad = ArcTangent(yaw.sine, yaw.cosine);  // in [-pi, pi]
//
// Minimax polynomials of the Cephes library (Moshier, 1989: sinf.c, cosf.c, atanf.c). Errors, held against
// <cmath> by a test: 2e-7 for sine and cosine of |angle| <= 100 rad, 4e-7 rad for the arc tangent.
#pragma once

namespace tiltproof::firmware {

inline constexpr float kPi = 3.14159265358979F;

struct SineCosine {
  float sine = 0, cosine = 1;
};

// |angle_rad| <= 100; numbers without meaning for others.
SineCosine ComputeSineCosine(float angle_rad);

// The angle of the point (x, y), in [-pi, pi]; 0 for the origin.
float ArcTangent(float y, float x);

// The same angle in (-pi, pi], for |angle_rad| <= 100; 0 for what is no angle.
float WrapAngle(float angle_rad);

}  // namespace tiltproof::firmware
