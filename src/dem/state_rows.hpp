// Between a State, as files and users see it, and the rows that engines work on.
#pragma once
#include <vector>

#include "dem/body/motion.hpp"
#include "dem/engine.hpp"
#include "dem/grain.hpp"
#include "dem/leapfrog.hpp"

namespace moraine::dem {

// Rows of all grains, held ones with the velocity they are held at.
std::vector<GrainRow> grain_rows(const Scene& scene, const State& state);
// Velocities at step n of grains whose velocities are those of n already (a state that is not staggered).
NowRow now_row(const GrainRow& grain);

// Whether grains and pore water meet at this step.
MORAINE_HD bool exchanges(const Scene& scene, std::int64_t step) {
  return scene.exchange_interval > 0 && step % scene.exchange_interval == 0;
}
// What the water of the last exchange does to bodies at this step.
MORAINE_HD WaterReaction reaction_at(const Scene& scene, const WaterReaction& last_exchange,
                                     std::int64_t step) {
  if (exchanges(scene, step) || scene.exchange_interval == 0) return last_exchange;
  return {last_exchange.wall_between, 0, 0, last_exchange.wall_between};
}
// A load with the impulse of the water that this step adds to it, if any.
MORAINE_HD LoadRow with_water(const Scene& scene, std::int64_t step, LoadRow load, const Vec3d& water) {
  if (exchanges(scene, step)) load.f = axpy(static_cast<double>(scene.exchange_interval), water, load.f);
  return load;
}
// W, what the forces of viscous contacts do to a grain at step n, when its velocity is half a step further.
// `whole`: its load with the water's.
MORAINE_HD double damping_power(const Scene& scene, const GrainRow& g, const LoadRow& whole,
                                const LoadRow& damping, double dt) {
  const Mobility m = mobility(scene, g);
  return dot(damping.f, axpy(0.5 * dt, m.acceleration(whole.f), g.v)) +
         dot(damping.torque, axpy(0.5 * dt, m.spin_acceleration(whole.torque), g.omega));
}
// N, the whole force that the leapfrog applies to a grain at the state's step, without gravity.
Vec3d kick(const Scene& scene, const State& s, Index i);

// What begins a stage, after its first forces: velocities of bodies to n - 1/2, the ledger opened.
void start_half_a_step_back(const Scene& scene, const Reaction& reaction, const WaterReaction& water,
                            BodyMotion& bodies);
void half_step_back(const Scene& scene, GrainRow& grain, const LoadRow& whole);

void append_grain(State& s, const GrainRow& grain, const LoadRow& load, BodyId part_of);
// Only if they touch.
void append_contact(State& s, const Scene& scene, const Sides& sides, const GrainRow& a, const GrainRow& b,
                    Index i, Index j, const Spring<double>& spring);
void append_wall_contact(State& s, const Scene& scene, const Plane& plane, const GrainRow& grain, Index i,
                         const Spring<double>& spring);
// Sorts the contacts, stores the bodies, marks the state staggered.
void finish_state(State& s, const BodyMotion& bodies);

}  // namespace moraine::dem
