#include "dem/observe.hpp"

#include <algorithm>

#include "dem/body/plane_contact.hpp"
#include "dem/state_rows.hpp"

namespace moraine::dem {

namespace {

GrainRow grain_at(const State& s, Index i, const std::vector<Vec3d>& v, const std::vector<Vec3d>& omega) {
  return {s.x[i], s.r[i], v[i], s.r[i], omega[i], 0, {0, 0, 0}, 0};
}

struct Velocities {
  std::vector<Vec3d> v, omega;
};
BodyMotion bodies_at_step(const Scene& scene, const State& s) {
  BodyMotion bodies = motion_of(scene, s);
  if (s.staggered) bodies.half_step(scene, 1);
  return bodies;
}
Velocities at_step(const Scene& scene, const State& s) {
  Velocities w{s.v, s.omega};
  if (!s.staggered) return w;
  for (Index i = 0; i < s.size(); ++i) {
    const Mobility m = mobility(scene, s.r[i], s.material_of(i), s.part_of[i]);
    w.v[i] = axpy(0.5 * scene.dt, m.acceleration(kick(scene, s, i)), s.v[i]);
    w.omega[i] = axpy(0.5 * scene.dt, m.spin_acceleration(s.torque[i]), s.omega[i]);
  }
  const BodyMotion bodies = bodies_at_step(scene, s);
  for (int k = 0; k < bodies.servos; ++k) {
    const Servo& layer = bodies.servo[k];
    if (layer.is_plane() || !layer.tells_grains()) continue;
    for (Index i = 0; i < s.size(); ++i)
      if (s.part_of[i] == layer.body) w.v[i][layer.axis] = layer.share(scene, s.x[i]) * layer.v;
  }
  return w;
}

// Whether contacts remember the force of their dampers at the state's step. Else it is worked out from the
// velocities at the step, which the engine foresaw a little differently.
bool dampers_are_known(const Scene& scene, const State& s, const ContactParameters& p) {
  return s.staggered && scene.ledger && Restitution::used(p);
}

const ContactParameters& between(const Scene& scene, const State& s, const Contact& c) {
  return scene.between(s.material_of(c.i), s.material_of(c.j));
}
const ContactParameters& at_plane(const Scene& scene, const State& s, Index i, BodyId plane) {
  return scene.between(s.material_of(i), scene.body(plane).material);
}

// Springs are left as they are, here and in for_each_contact. A plane that is gone bears nothing.
std::vector<WallForce> wall_forces(const Scene& scene, const State& s, const Velocities& at) {
  std::vector<WallForce> out;
  const BodyMotion bodies = bodies_at_step(scene, s);
  for (const WallContact& w : s.wall_contacts) {
    const Plane* plane = bodies.find(w.wall);
    if (!plane) continue;
    const GrainRow g = grain_at(s, w.i, at.v, at.omega);
    Spring<double> spring = w.spring;
    const ContactParameters& law = at_plane(scene, s, w.i, w.wall);
    const Vec3d f =
        dampers_are_known(scene, s, law)
            ? remembered_force<GeneralLaw>(law, plane->geometry(g.x, g.r), spring)
            : plane_action<GeneralLaw, Account::none>(scene, 0, *plane, g, spring, s.material_of(w.i)).f;
    out.push_back({w.i, w.wall, std::abs(f[plane->axis]), f, plane->gap(g.x, g.r)});
  }
  return out;
}

// use(contact, geometry, force on i in N) for each grain contact.
template <class Use>
void for_each_contact(const Scene& scene, const State& s, Use&& use) {
  const Sides sides = Sides::of(scene);
  const Velocities at = at_step(scene, s);
  for (const Contact& c : s.contacts) {
    const Vec3d x_ij = nearest_image(sides, s.x[c.i] - s.x[c.j]);
    const Geometry<double> g = between_grains(x_ij, s.r[c.i] + s.r[c.j], s.r[c.i] - s.r[c.j]);
    const Motion<double> motion{at.v[c.i] - at.v[c.j], at.omega[c.i], at.omega[c.j]};
    Spring<double> spring = c.spring;
    const ContactParameters& law = between(scene, s, c);
    use(c, g,
        dampers_are_known(scene, s, law)
            ? remembered_force<GeneralLaw>(law, g, spring)
            : contact_law<GeneralLaw, Account::none>(law, 0, g, motion, spring).f);
  }
}

// Adds to `sum` what the next step has, both sorted by key; those that neither had before come in between.
template <class Force, class Key, class Add>
void merge(std::vector<Force>& sum, const std::vector<Force>& next, Key&& key, Add&& add) {
  std::vector<Force> out;
  out.reserve(std::max(sum.size(), next.size()));
  auto a = sum.begin();
  for (const Force& b : next) {
    while (a != sum.end() && key(*a) < key(b)) out.push_back(*a++);
    out.push_back(b);
    if (a != sum.end() && key(*a) == key(b)) add(out.back(), *a++);
  }
  out.insert(out.end(), a, sum.end());
  sum = std::move(out);
}

}  // namespace

std::vector<Vec3d> velocity(const Scene& scene, const State& s) { return at_step(scene, s).v; }

std::vector<ContactForce> contact_forces(const Scene& scene, const State& s) {
  std::vector<ContactForce> out;
  out.reserve(s.contacts.size());
  for_each_contact(scene, s, [&](const Contact& c, const Geometry<double>& g, const Vec3d& f) {
    const Vec3d f_n = dot(f, g.n) * g.n;
    out.push_back({c.i, c.j, s.x[c.i] - g.l_i * g.n, f_n, f - f_n, -g.delta_n});
  });
  return out;
}

void mark_slipping(const Scene& scene, State& s) {
  constexpr double rounding = 1e-12;  // of the force that slip leaves
  std::vector<double> slipping;
  for_each_contact(scene, s, [&](const Contact& c, const Geometry<double>& g, const Vec3d& f) {
    const ContactParameters& p = between(scene, s, c);
    if (SofteningCoulomb::keeps(p)) return slipping.push_back(c.spring.slipping);  // it knows
    Vec3d f_n = dot(f, g.n) * g.n;
    const Vec3d f_t = f - f_n;
    f_n -= GeneralLaw::more_normal(p, g, 0.0) * g.n;  // the limit does not see it
    const double limit = (1 - rounding) * p.mu_d;
    const double f_t2 = dot(f_t, f_t), f_n2 = dot(f_n, f_n);
    slipping.push_back(f_t2 > 0 && f_t2 >= limit * limit * f_n2 ? 1 : 0);
  });
  for (std::size_t k = 0; k < slipping.size(); ++k) s.contacts[k].spring.slipping = slipping[k];
}

Loads loads_of(const Scene& scene, const State& s) {
  double shear_force = s.at(BodyId::top_layer).force.x;
  if (scene.body(BodyId::top_layer).x.profile != Profile::uniform) {  // where that is by shares
    shear_force = 0;
    for (Index i = 0; i < s.size(); ++i)
      if (s.part_of[i] == BodyId::top_layer) shear_force += s.force[i].x;
  }
  return {contact_forces(scene, s), wall_forces(scene, s, at_step(scene, s)), s.force,
          s.at(BodyId::top_wall).force.z, shear_force};
}

void add(Loads& sum, const Loads& next) {
  merge(
      sum.contacts, next.contacts, [](const ContactForce& c) { return std::pair(c.i, c.j); },
      [](ContactForce& to, const ContactForce& c) {
        to.f_n += c.f_n, to.f_t += c.f_t, to.overlap += c.overlap;
      });
  merge(
      sum.walls, next.walls, [](const WallForce& w) { return std::pair(w.wall, w.i); },
      [](WallForce& to, const WallForce& w) { to.f_n += w.f_n, to.f += w.f, to.delta_n += w.delta_n; });
  for (std::size_t i = 0; i < sum.force.size(); ++i) sum.force[i] += next.force[i];
  sum.wall_force += next.wall_force, sum.shear_force += next.shear_force;
}

Loads mean(Loads sum, std::int64_t steps) {
  if (steps == 1) return sum;
  const double share = 1 / static_cast<double>(steps);
  for (ContactForce& c : sum.contacts) c.f_n = share * c.f_n, c.f_t = share * c.f_t, c.overlap *= share;
  for (WallForce& w : sum.walls) w.f_n *= share, w.f = share * w.f, w.delta_n *= share;
  for (Vec3d& f : sum.force) f = share * f;
  sum.wall_force *= share, sum.shear_force *= share;
  return sum;
}

std::vector<double> grain_pressure(const State& s, const Loads& loads) {
  std::vector<double> sum(s.size(), 0);
  for (const ContactForce& c : loads.contacts) {
    const double f = std::sqrt(dot(c.f_n, c.f_n));
    sum[c.i] += f, sum[c.j] += f;
  }
  for (const WallForce& w : loads.walls) sum[w.i] += w.f_n;
  for (Index i = 0; i < s.size(); ++i) sum[i] /= 4 * std::numbers::pi * s.r[i] * s.r[i];
  return sum;
}

Observation observe(const Scene& scene, const State& s) { return observe(scene, s, loads_of(scene, s)); }

Observation observe(const Scene& scene, const State& s, const Loads& loads) {
  Observation o;
  const double area = scene.area();
  const bool has_wall = scene.has(BodyId::top_wall);
  const Velocities at = at_step(scene, s);

  double floor_force = 0;
  for (const WallForce& w : loads.walls)
    if (w.wall == BodyId::floor) floor_force += w.f.z;
  double water_on_layer = 0;
  for (Index i = 0; i < static_cast<Index>(s.water_force.size()); ++i)
    if (s.part_of[i] == BodyId::top_layer) water_on_layer += s.water_force[i].x;
  o.shear_stress = -(loads.shear_force + water_on_layer) / area;
  o.normal_stress = (has_wall ? loads.wall_force : floor_force) / area;

  double volume = 0;
  const auto inside = [&](const Vec3d& x) {  // or gone by an open side
    return (scene.periodic_x || (x.x >= 0 && x.x <= scene.box.x)) &&
           (scene.periodic_y || (x.y >= 0 && x.y <= scene.box.y));
  };
  for (Index i = 0; i < s.size(); ++i) {
    if (inside(s.x[i])) volume += sphere_volume(s.r[i]);
    o.height = std::max(o.height, s.x[i].z + s.r[i]);
  }
  if (has_wall) o.height = s.wall_z();
  o.porosity = 1 - volume / (area * (scene.periodic_z ? scene.box.z : o.height));

  double normal_force = 0;
  for (const ContactForce& c : loads.contacts) {
    o.mean_overlap += c.overlap;
    o.max_overlap = std::max(o.max_overlap, c.overlap);
    normal_force += std::sqrt(dot(c.f_n, c.f_n));
  }
  if (!loads.contacts.empty()) {
    const auto count = static_cast<double>(loads.contacts.size());
    o.mean_overlap /= count;
    o.coordination = 2.0 * count / s.size();
    normal_force /= count;
  }

  Energy& e = o.energy;
  const Sides sides = Sides::of(scene);
  const double dt = s.staggered ? scene.dt : 0;
  const auto store = [&](const ContactParameters& p, const Geometry<double>& g, const Vec3d& v,
                         const Spring<double>& spring) {
    e.elastic_normal += GeneralLaw::stored_normal(p, g, -dt * dot(v, g.n));
    e.elastic_tangential += GeneralLaw::stored_tangential(p, g, spring);
  };
  for (const Contact& c : s.contacts)
    store(between(scene, s, c),
          between_grains(nearest_image(sides, s.x[c.i] - s.x[c.j]), s.r[c.i] + s.r[c.j], s.r[c.i] - s.r[c.j]),
          s.v[c.i] - s.v[c.j], c.spring);
  const BodyMotion bodies = motion_of(scene, s);
  for (const WallContact& w : s.wall_contacts)
    if (const Plane* plane = bodies.find(w.wall))
      store(at_plane(scene, s, w.i, w.wall), plane->geometry(s.x[w.i], s.r[w.i]), s.v[w.i] - plane->v,
            w.spring);

  double net = 0;
  Index free = 0;
  for (Index i = 0; i < s.size(); ++i) {
    const Material material = s.material_of(i);
    const Mobility mob = mobility(scene, s.r[i], material, s.part_of[i]);
    const double m = scene.inertial_mass(s.r[i], material), inertia = 0.4 * m * s.r[i] * s.r[i];
    // 1/2 m v(n-1/2).v(n+1/2)
    const auto before_times_after = [](const Vec3d& before, const Vec3d& at) {
      return dot(before, at + (at - before));
    };
    e.kinetic += 0.5 * m * before_times_after(s.v[i], at.v[i]);
    e.rotational += 0.5 * inertia * before_times_after(s.omega[i], at.omega[i]);
    if (s.part_of[i] != BodyId::none) continue;
    const double height = -(scene.down.x * s.x[i].x + scene.down.z * s.x[i].z);
    e.potential +=
        sphere_mass(scene.density_of(material), s.r[i]) * scene.submerged_gravity(material) * height;
    const Vec3d a =
        mob.acceleration(s.water_force.empty() ? loads.force[i] : loads.force[i] + s.water_force[i]);
    net += m * std::sqrt(dot(a, a));
    ++free;
  }
  if (free > 0 && normal_force > 0) o.unbalanced_force = net / free / normal_force;
  for (int k = 0; k < bodies.servos; ++k) {
    const Servo& servo = bodies.servo[k];
    if (!servo.by_stress()) continue;
    const double half = s.staggered ? 0.5 * scene.dt * servo.acceleration(area) : 0;
    const double mass = scene.body(servo.body).mass;  // a layer's grains have been counted
    e.wall_kinetic += 0.5 * mass * servo.v * (servo.v + 2 * half);
  }
  return o;
}

}  // namespace moraine::dem
