// What is added to a chunk's loads once its pairs are done: the shares of other chunks' pairs, and planes.
// And what the grains do to the bodies in turn, and what viscous contacts take.
#include "dem/body/plane_contact.hpp"
#include "dem/cpu/rows.hpp"
#include "dem/cpu/tasks.hpp"
#include "dem/fluid_coupling.hpp"
#include "dem/leapfrog.hpp"

namespace moraine::dem::cpu {

namespace {

void collect(const Bed& bed, const Chunk& chunk, LoadRow* load, const LoadRow* slots) {
  for (const Index l : chunk.incoming) {
    const Link& link = bed.links[l];
    for (Index slot = link.first; slot < link.first + link.used; ++slot) {
      LoadRow& to = load[bed.slot_owner.data()[slot]];
      set_row(to.f, row(to.f) + row(slots[slot].f));
      set_row(to.torque, row(to.torque) + row(slots[slot].torque));
    }
  }
}

void shares(Bed& bed, Chunk& chunk, const ChunkStep& at) {
  collect(bed, chunk, at.load, bed.slot.data());
  if (bed.uses.damped_grains && bed.uses.ledger)
    collect(bed, chunk, bed.damping.data(), bed.damping_slot.data());
}

template <class L, Account account>
void plane_forces(Bed& bed, Chunk& chunk, const ChunkStep& at) {
  constexpr bool damping_ledger = L::damps && account == Account::energy;
  const BodyMotion& bodies = at.bodies;
  ChunkSum force[most_servos], damping[most_servos];
  for (PlanePair& p : chunk.planes) {
    const GrainRow& g = bed.grain.data()[p.i];
    const NowRow now = L::damps ? bed.now.data()[p.i] : NowRow{};
    const PlaneAction a = plane_action<L, account>(bed.scene, at.dt, bodies.plane[p.plane], g, now, p.spring);
    at.load[p.i].add(a.f, a.torque, a.slip);
    if constexpr (damping_ledger) bed.damping.data()[p.i].add(a.f_viscous, a.torque_viscous, 0);
    for (int k = 0; k < bodies.servos; ++k) {
      const Servo& servo = bodies.servo[k];
      if (servo.plane != p.plane) continue;
      force[k].add(p.i, -a.f[servo.axis]);
      if constexpr (damping_ledger) damping[k].add(p.i, -a.f_viscous[servo.axis]);
    }
  }
  Reaction& reaction = chunk.at(bodies.step).reaction;
  for (int k = 0; k < bodies.servos; ++k)
    if (bodies.servo[k].is_plane())
      reaction.force[k] = force[k].total(), reaction.damping[k] = damping[k].total();
}

void layer_forces(Bed& bed, Chunk& chunk, const ChunkStep& at) {
  Reaction& reaction = chunk.at(at.bodies.step).reaction;
  for (int k = 0; k < at.bodies.servos; ++k) {
    const Servo& servo = at.bodies.servo[k];
    if (servo.is_plane()) continue;
    ChunkSum force, damping;
    for (const Index i : chunk.members[k]) {
      force.add(i, at.load[i].f[servo.axis]);
      if (bed.uses.damping_ledger()) damping.add(i, bed.damping.data()[i].f[servo.axis]);
    }
    reaction.force[k] = force.total(), reaction.damping[k] = damping.total();
  }
}

// Takes the viscous loads, which are zero afterwards. Of the water's push it knows that of the last exchange:
// the present one may not have been solved yet.
void damping_power_of(Bed& bed, Chunk& chunk, const ChunkStep& at) {
  ChunkSum power;
  for (Index i = chunk.begin; i < chunk.end; ++i) {
    LoadRow& damping = bed.damping.data()[i];
    const LoadRow whole = bed.uses.water
                              ? with_water(bed.scene, at.bodies.step, at.load[i], bed.water.data()[i].f)
                              : at.load[i];
    power.add(i, damping_power(bed.scene, bed.grain.data()[i], whole, damping, at.dt));
    damping = {};
  }
  chunk.at(at.bodies.step).reaction.damping_power = power.total();
}

}  // namespace

ChunkTask shares_for(const Scene&) { return shares; }
ChunkTask layer_forces_for(const Scene&) { return layer_forces; }
ChunkTask damping_power_for(const Scene&) { return damping_power_of; }

ChunkTask plane_forces_for(const Scene& scene) {
  ChunkTask task = nullptr;
  with_laws(scene,
            [&]<class Row, Account account>() { task = &plane_forces<typename Row::AtPlanes, account>; });
  return task;
}

}  // namespace moraine::dem::cpu
