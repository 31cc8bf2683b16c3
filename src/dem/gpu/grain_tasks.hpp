// The tasks of a step (step.hpp) for one grain, on the GPU: it walks its own contacts in the order of
// sums.hpp, so no two threads write to one place. A few lanes share a grain's contacts.
#pragma once
#include <limits>

#include "dem/body/plane_contact.hpp"
#include "dem/gpu/view.hpp"
#include "dem/leapfrog.hpp"

namespace moraine::dem::gpu {

template <class Laws, Account account>
struct GrainTasks {
  using Grains = typename Laws::BetweenGrains;
  using Planes = typename Laws::AtPlanes;

  const GatherView& w;
  const BodyMotion& bodies;
  std::int64_t step;

  // All lanes come here; what counts is the sums of lane 0.
  template <class Item>
  MORAINE_TEAM void pair_forces(const Item& item, Index i, LoadRow& load) const {
    const std::int64_t end = w.row[i + 1];
    std::int64_t k = w.row[i] + item.lane;
    // The next neighbour is asked for before this one's contact is worked out: memory is far away.
    Index j = k < end ? w.neighbour[k] : i;
    for (; item.any(k - item.lane < end); k += Item::lanes) {
      const Index next = k + Item::lanes < end ? w.neighbour[k + Item::lanes] : i;
      Share share{};
      if (k < end) share = contact(i, j, w.spring[k]);
      j = next;
      item.in_order(share, [&](const Share& s) {
        load.f += s.f, load.torque = axpy(s.lever, s.f_x_n, load.torque);
        load.slip += s.slip, load.viscous += s.viscous;
      });
    }
  }

  // A plane that is further off than the margin did not touch in the step before either.
  MORAINE_HD void plane_forces(Index i, LoadRow& load, Tally& tally) const {
    if (!meets_planes(w.scene, w.part_of[i])) return;
    const GrainRow& g = w.grain[step & 1][i];
    for (int p = 0; p < bodies.planes; ++p) {
      const Plane& plane = bodies.plane[p];
      if (!(plane.gap(g.x, g.r) < w.margin)) continue;
      const PlaneAction a = plane_action<Planes, account>(
          w.scene, w.scene.dt, plane, g, w.plane_spring[bodies.planes * i + p], w.material(i));
      load.f += a.f, load.torque += a.torque, load.slip += a.slip, load.viscous += a.viscous;
      for (int k = 0; k < bodies.servos; ++k) {
        const Servo& servo = bodies.servo[k];
        if (servo.plane != p) continue;
        tally.sum[w.tallies.force(k)] = -a.f[servo.axis];
      }
    }
  }

  MORAINE_HD void layer_forces(Index i, const LoadRow& load, Tally& tally) const {
    if (w.part_of[i] == BodyId::none) return;
    for (int k = 0; k < bodies.servos; ++k) {
      const Servo& servo = bodies.servo[k];
      if (servo.is_plane() || servo.body != w.part_of[i]) continue;
      tally.sum[w.tallies.force(k)] = servo.drive.profile == Profile::uniform
                                          ? load.f[servo.axis]
                                          : servo.share(w.scene, w.grain[step & 1][i].x) * load.f[servo.axis];
    }
  }

  // To step + 1; returns its speed as Tally has it.
  MORAINE_HD float motion(Index i, const LoadRow& load) const {
    GrainRow g = w.grain[step & 1][i];
    const Servo* const servo = servo_of(w.part_of[i]);
    if (servo)
      g.v.set(servo->axis,
              servo->share(w.scene, g.x) *
                  (servo->by_stress() ? servo->v : servo->next_velocity(w.scene.time(step), w.scene.dt)));
    const Triple dt(Vec3d{w.scene.dt, w.scene.dt, w.scene.dt});
    const Mobility m = mobility(w.scene, g, w.material(i));
    const Triple acceleration = m.acceleration(pushed(i, load).f),
                 spin_acceleration = m.spin_acceleration(load.torque);
    Kinematics<Triple> k{g.x, g.v, g.omega, g.rotation};
    leapfrog(k, acceleration, spin_acceleration, dt);
    g.x = k.x, g.v = k.v, g.omega = k.omega, g.rotation = k.rotation;
    const int next = (step + 1) & 1;
    w.grain[next][i] = g;
    return is_lost(bodies, g) ? std::numeric_limits<float>::infinity()
                              : 1.000001f * static_cast<float>(dot(g.v, g.v));
  }

 private:
  struct Share {
    Vec3d f;
    double slip;
    Vec3d f_x_n;
    double lever, viscous;
  };

  // What the contact with j does to i.
  MORAINE_HD Share contact(Index i, Index j, SpringRow& kept) const {
    const GrainRow* const grain = w.grain[step & 1];
    const bool first = i < j;
    const GrainRow a = grain[first ? i : j], b = grain[first ? j : i];  // copies, read 16 bytes at a time
    const Geometry<double> g = between_grains(nearest_image(w.sides, a.x - b.x), a.r + b.r, a.r - b.r);
    const ContactParameters& law = w.scene.contact[w.order.pair(i, j)];
    SpringRow spring = kept;  // read and written 16 bytes at a time, and only what the law uses
    const Action<double> action =
        contact_law<Grains, account>(law, w.scene.dt, g, {a.v - b.v, a.omega, b.omega}, spring);
    kept = spring;
    if constexpr (Grains::couples) {
      if (first) return {action.f, action.slip, action.torque_on_i(g), 1, action.viscous};
      return {-action.f, 0, action.torque_on_j(g), 1, 0};
    }
    if (first) return {action.f, action.slip, action.f_x_n, g.l_i, action.viscous};
    // The share of a pair of an earlier chunk comes by way of a slot on the CPU, where its torque is rounded
    // by itself.
    if (w.order.comes_from_earlier_chunk(i, j)) return {-action.f, 0, g.l_j * action.f_x_n, 1, 0};
    return {-action.f, 0, action.f_x_n, g.l_j, 0};
  }

  MORAINE_HD LoadRow pushed(Index i, const LoadRow& load) const {
    return w.water ? with_water(w.scene, step, load, w.water[i].f) : load;
  }

  // A layer moves with its servo, whatever the forces on each of its grains; null where these have its
  // velocity already.
  MORAINE_HD const Servo* servo_of(BodyId layer) const {
    if (layer == BodyId::none) return nullptr;
    for (int k = 0; k < bodies.servos; ++k)
      if (bodies.servo[k].body == layer && bodies.servo[k].tells_grains()) return &bodies.servo[k];
    return nullptr;
  }
};

}  // namespace moraine::dem::gpu
