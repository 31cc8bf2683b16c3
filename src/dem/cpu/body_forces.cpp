// What is added to a chunk's loads once its pairs are done: the shares of other chunks' pairs, and planes.
// And what the grains do to the bodies in turn.
#include "dem/body/plane_contact.hpp"
#include "dem/cpu/rows.hpp"
#include "dem/cpu/tasks.hpp"

namespace moraine::dem::cpu {

namespace {

void shares(Bed& bed, Chunk& chunk, const ChunkStep& at) {
  const LoadRow* const slots = bed.slot.data();
  for (const Index l : chunk.incoming) {
    const Link& link = bed.links[l];
    for (Index slot = link.first; slot < link.first + link.used; ++slot) {
      LoadRow& to = at.load[bed.slot_owner.data()[slot]];
      set_row(to.f, row(to.f) + row(slots[slot].f));
      set_row(to.torque, row(to.torque) + row(slots[slot].torque));
    }
  }
}

template <class L, Account account>
[[gnu::flatten]] void plane_forces(Bed& bed, Chunk& chunk, const ChunkStep& at) {
  const BodyMotion& bodies = at.bodies;
  ChunkSum force[most_servos];
  for (PlanePair& p : chunk.planes) {
    const bool touches = bodies.plane[p.plane].gap(bed.grain.data()[p.i].x, bed.grain.data()[p.i].r) < 0;
    if (!touches && !p.touched) continue;  // one that has just opened gives up what its spring held
    p.touched = touches;
    const PlaneAction a = plane_action<L, account>(bed.scene, at.dt, bodies.plane[p.plane],
                                                   bed.grain.data()[p.i], p.spring, bed.material_of(p.i));
    LoadRow& load = at.load[p.i];
    load.f += a.f, load.torque += a.torque, load.slip += a.slip, load.viscous += a.viscous;
    for (int k = 0; k < bodies.servos; ++k) {
      const Servo& servo = bodies.servo[k];
      if (servo.plane != p.plane) continue;
      force[k].add(p.i, -a.f[servo.axis]);
    }
  }
  Reaction& reaction = chunk.at(bodies.step).reaction;
  for (int k = 0; k < bodies.servos; ++k)
    if (bodies.servo[k].is_plane()) reaction.force[k] = force[k].total();
}

void layer_forces(Bed& bed, Chunk& chunk, const ChunkStep& at) {
  Reaction& reaction = chunk.at(at.bodies.step).reaction;
  for (int k = 0; k < at.bodies.servos; ++k) {
    const Servo& servo = at.bodies.servo[k];
    if (servo.is_plane()) continue;
    ChunkSum force;
    if (servo.drive.profile == Profile::uniform)
      for (const Index i : chunk.members[k]) force.add(i, at.load[i].f[servo.axis]);
    else
      for (const Index i : chunk.members[k])
        force.add(i, servo.share(bed.scene, bed.grain.data()[i].x) * at.load[i].f[servo.axis]);
    reaction.force[k] = force.total();
  }
}

}  // namespace

ChunkTask shares_for(const Scene&) { return shares; }
ChunkTask layer_forces_for(const Scene&) { return layer_forces; }

ChunkTask plane_forces_for(const Scene& scene) {
  ChunkTask task = nullptr;
  with_laws(scene,
            [&]<class Row, Account account>() { task = &plane_forces<typename Row::AtPlanes, account>; });
  return task;
}

}  // namespace moraine::dem::cpu
