// Moves the grains of a chunk on to the next step (leapfrog.hpp), and leaves their loads empty.
#include <limits>

#include "dem/cpu/rows.hpp"
#include "dem/cpu/tasks.hpp"
#include "dem/leapfrog.hpp"

namespace moraine::dem::cpu {

namespace {

constexpr int rows_ahead = 8;  // that it asks to write to

enum class Viscous { no, yes };  // whether contacts dissipate by damping
enum class Impulse { none, of_water };

// A layer moves with its servo, whatever the forces on each of its grains. One that a stress drives has its
// new velocity already; one that is given is known ahead.
template <class Use>
void for_each_servo_grain(const Scene& scene, const Chunk& chunk, const ChunkStep& at, Use&& use) {
  for (int k = 0; k < at.bodies.servos; ++k) {
    const Servo& s = at.bodies.servo[k];
    if (s.is_plane() || !s.tells_grains()) continue;
    const double v = s.by_stress() ? s.v : s.next_velocity(scene.time(at.step), scene.dt);
    for (const Index i : chunk.members[k]) use(i, s, v);
  }
}

template <Viscous viscous, Impulse impulse>
void move(Bed& bed, Chunk& chunk, const ChunkStep& at) {
  const Scene& scene = bed.scene;
  GrainRow* const grain = bed.grain.data();
  LoadRow* const loads = at.load;
  for_each_servo_grain(scene, chunk, at, [&](Index i, const Servo& s, double v) {
    grain[i].v[s.axis] = s.share(scene, grain[i].x) * v;
  });
  const Row zero(0.0), dt(scene.dt, scene.dt, scene.dt, 0);
  const Row all_three(1, 1, 1, 0), only_z(0, 0, 1, 0), down(scene.down.x, scene.down.y, scene.down.z, 0);
  const Row usual_fall = Row(scene.submerged_gravity(Material::grain)) * down;
  // Below this radius a grain falls in its own way: with several materials each does.
  const double falls_alike =
      bed.material.empty() ? scene.least_inertia : std::numeric_limits<double>::infinity();
  [[maybe_unused]] const Row steps(static_cast<double>(scene.exchange_interval));
  // The fourth numbers of these are energies.
  Row sum_f = zero, group_f = zero, sum_torque = zero, group_torque = zero, fastest2 = zero;
  for (Index i = chunk.begin; i < chunk.end; ++i) {
    // Other threads have read these rows; asking for several at once to write to saves most of the waiting.
    __builtin_prefetch(&grain[i + rows_ahead].x, 1), __builtin_prefetch(&grain[i + rows_ahead].omega, 1);
    GrainRow& g = grain[i];
    const bool free = g.inverse_inertia > 0;  // as in mobility()
    const Row inverse_mass = Row(g.inverse_mass) * (free ? all_three : only_z);
    const Row f = row(loads[i].f), torque = row(loads[i].torque);
    Row force = f;
    if constexpr (impulse == Impulse::of_water)
      if (at.push) force = fma(steps, row(at.push[i].f), f);
    Row fall = free ? usual_fall : zero;
    if (free && g.r < falls_alike) fall = Row(scene.fall(g.r, bed.material_of(i))) * down;
    const Row acceleration = fma(force, inverse_mass, fall);
    const Row spin_acceleration = torque * Row(g.inverse_inertia);
    Kinematics<Row> k{row(g.x), row(g.v), row(g.omega), row(g.rotation)};
    leapfrog(k, acceleration, spin_acceleration, dt);
    set_row(g.x, k.x), set_row(g.v, k.v), set_row(g.omega, k.omega), set_row(g.rotation, k.rotation);
    group_f += f;
    if (ends_group(i)) sum_f += group_f, group_f = zero;
    if constexpr (viscous == Viscous::yes) {
      group_torque += torque;
      if (ends_group(i)) sum_torque += group_torque, group_torque = zero;
    }
    fastest2 = max(k.v * k.v, fastest2);
    set_row(loads[i].f, zero), set_row(loads[i].torque, zero);
  }
  Chunk::Tally& tally = chunk.at(at.step);
  tally.lost = {(sum_f + group_f)[3], (sum_torque + group_torque)[3]};
  for (int a = 0; a < 3; ++a) tally.fastest2[a] = fastest2[a];
}

}  // namespace

ChunkTask motion_for(const Scene& scene) {
  const Uses u = uses_of(scene);
  if (u.damping() && u.ledger)
    return u.water ? move<Viscous::yes, Impulse::of_water> : move<Viscous::yes, Impulse::none>;
  return u.water ? move<Viscous::no, Impulse::of_water> : move<Viscous::no, Impulse::none>;
}

}  // namespace moraine::dem::cpu
