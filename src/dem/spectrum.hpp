// The largest frequency of the present contact network, and the longest step that leapfrog survives there.
//
//   u'' = -M^-1 K u - M^-1 C u',  u: displacements and rotations of all grains, the top wall and the top
//   layer where stresses drive them. A contact adds k_n n n^T and k_t (1 - n n^T) at the contact point (lever
//   arms of eq. 4) to K, gamma_n and gamma_t likewise to C. dt_c = 2/(c + sqrt(c^2 + w^2)),  w^2, c: largest
//   eigenvalues of M^-1 K (rad2/s2) and M^-1 C (1/s)
//
// Viscous forces use a velocity foreseen from the last two half steps, so a mode with w, c obeys
// z (z-1)^2 + w^2 dt^2 z^2 + c dt (z-1)(3z-1)/2 = 0 for its growth z a step: stable as long as
// w^2 dt^2 + 4 c dt < 4, leaving through z = -1. Taking both largest eigenvalues together makes dt_c a bound,
// exact where one mode has both (gamma_n/k_n = gamma_t/k_t), 2/w without damping.
//
// Assumed: every contact with friction sticks (one that slides loses its tangential spring, and feels its
// normal force instead); no pull of the pressed contacts towards buckling (-f_n/|x_ij|, an overlap's part of
// k_n, lowers w); no contact opens or closes.
#pragma once
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::dem {

struct Spectrum {
  double stiffness = 0;  // rad2/s2, largest eigenvalue of M^-1 K, from above; 0 without contacts
  double damping = 0;    // 1/s, of M^-1 C
};

// By Lanczos iteration, each plus the residual of its eigenvector (up to 1 %). The same state gives the same
// bits.
Spectrum spectrum(const Scene& scene, const State& state);

double critical_step(const Spectrum& spectrum);  // s; infinite without contacts

// The critical step of the two smallest grains touching one another, or of one of them and a wall, alone:
// what any first contact may need. s.
double one_contact_step(const Scene& scene, const State& state);

}  // namespace moraine::dem
