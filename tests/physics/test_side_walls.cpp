// Planes at the sides: what one grain does at them, what they bear of a column, the work of one that moves.
#include "backends.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

constexpr double R = 0.01;
constexpr BodyId sides[] = {BodyId::x_low, BodyId::x_high, BodyId::y_low, BodyId::y_high};

// A vector as the floor sees it, turned to where a plane with that normal sees the same. A mirror turns spins
// the other way, but not those about its normal.
struct Turned {
  int axis;
  bool high;
  Vec3d vector(const Vec3d& a) const {
    Vec3d out;
    for (int k = 0; k < 3; ++k) out[(axis + 1 + k) % 3] = a[k];
    if (high) out[axis] = -out[axis];
    return out;
  }
  Vec3d spin(const Vec3d& a) const { return high ? -1.0 * vector(a) : vector(a); }
  Vec3d place(const Vec3d& a, double box) const {
    Vec3d out = vector(a);
    if (high) out[axis] += box;
    return out;
  }
};

class SideWall : public OnEveryBackend {};

TEST_P(SideWall, ThrowsAGrainBackLikeTheFloor) {
  const auto engine = make();
  const double box = 0.25;
  Scene on_floor = empty_space(1e5);
  on_floor.body(BodyId::floor) = floor_at(0);
  on_floor.with(Material::wall) = LinearContact{1e5, 8e4, 10, 5, 0.3, 0.3};
  on_floor.dt = 0.01 * std::sqrt(mass(on_floor, R) / 1e5);
  const Vec3d x{0.1, 0.15, R + 1e-4}, v{0.15, -0.1, -0.2}, omega{3, 5, -7};
  State start = grains_at_rest({R}, {x});
  start.v[0] = v, start.omega[0] = omega;
  const auto under = [&](const State& s) { return !s.wall_contacts.empty(); };
  for (const std::int64_t steps : {200, 2000}) {  // while it touches, and after
    const State floor = run(*engine, on_floor, start, steps);
    ASSERT_EQ(under(floor), steps == 200);
    if (steps == 2000) {
      ASSERT_GT(floor.v[0].z, 0.1);
    }
    for (const BodyId side : sides) {
      const Turned turned{side == BodyId::y_low || side == BodyId::y_high ? 1 : 0,
                          side == BodyId::x_high || side == BodyId::y_high};
      Scene s = empty_space(1e5);
      s.box = {box, box, box};
      put_side_walls(s);
      s.contact = on_floor.contact, s.dt = on_floor.dt;
      State other = grains_at_rest({R}, {turned.place(x, box)});
      other.v[0] = turned.vector(v), other.omega[0] = turned.spin(omega);
      other = run(*engine, s, other, steps);
      ASSERT_EQ(under(other), under(floor)) << name_of(side);
      // At the far side of the box places are rounded at every step, some hundred times in contact; springs
      // turn that into speeds.
      const double rounding = 1000 * 1.1e-16 * box, w = std::sqrt(1e5 / mass(s, R));
      EXPECT_LT(length(other.x[0] - turned.place(floor.x[0], box)), rounding) << name_of(side);
      EXPECT_LT(length(other.v[0] - turned.vector(floor.v[0])), w * rounding) << name_of(side);
      EXPECT_LT(length(other.omega[0] - turned.spin(floor.omega[0])), 2.5 * w * rounding / R)
          << name_of(side);
    }
  }
}

// A grain between two walls that are closer than it is wide: both push it with N, and it falls with
// g - 2 mu N/m, or hangs. The turns that friction gives it on both sides cancel.
TEST_P(SideWall, LetsAGrainSlideAsCoulombSays) {
  const auto engine = make();
  const double k = 1e5, squeeze = 2e-6, n = k * squeeze;
  for (const int axis : {0, 1})
    for (const double share : {0.6, 1.4}) {  // of the weight that friction can bear
      Scene s = empty_space(k);
      s.box[axis] = 2 * (R - squeeze);
      put_side_walls(s, axis == 0, axis == 1);
      const double weight = mass(s, R) * 9.81, mu = share * weight / (2 * n);
      s.gravity = 9.81;
      s.with(Material::wall) = LinearContact{k, k, 0, 20, mu, mu};
      s.dt = 0.05 * std::sqrt(mass(s, R) / k);
      Vec3d x{0.5, 0.5, 0.5};
      x[axis] = R - squeeze;
      engine->load(s, grains_at_rest({R}, {x}));
      engine->advance(4000);
      const State before = engine->state();
      engine->advance(4000);
      const State after = engine->state();
      if (share < 1) {
        const double a = (before.v[0].z - after.v[0].z) / (4000 * s.dt);
        EXPECT_NEAR(a / ((1 - share) * s.gravity), 1, 1e-10);
      } else {
        EXPECT_LT(std::abs(after.v[0].z), 1e-10);
        EXPECT_NEAR(after.force[0].z / weight, 1, 1e-10);
      }
      EXPECT_LT(length(after.omega[0]) * R, 1e-12);
    }
}

// Rough walls bear grains that have slid down along them: its floor gave way by 1 mm and stopped.
Bed bed_that_sank() {
  Bed bed = walled_bed();
  const auto engine = make_engine(Backend::cpu, 1);
  Drive& floor = bed.scene.body(BodyId::floor).z;
  floor = Drive::at(-0.02);
  bed.state = run(*engine, bed.scene, bed.state, std::llround(1e-3 / (0.02 * bed.scene.dt)));
  synchronise(bed.scene, bed.state);
  floor = Drive::at(0), bed.state.at(BodyId::floor).v = {0, 0, 0}, bed.state.step = 0;
  return bed;
}

// What planes do to the grains, N.
struct Borne {
  double floor = 0, friction = 0;  // upwards
  Vec3d sideways{0, 0, 0};
};
Borne borne(const Loads& loads) {
  Borne b;
  for (const WallForce& w : loads.walls) {
    (w.wall == BodyId::floor ? b.floor : b.friction) += w.f.z;
    b.sideways += Vec3d{w.f.x, w.f.y, 0};
  }
  return b;
}

// The sum of what still moves is at most the mean net force of a grain, which the unbalanced force tells,
// times their number.
TEST_P(SideWall, AndFloorBearTheWeight) {
  const auto engine = make();
  for (const double mu : {0.0, 0.4}) {
    const Bed bed = mu == 0 ? column_between_walls(300, 5, 0, 45000) : bed_that_sank();
    const Scene& s = bed.scene;
    double weight = 0, bound = 0;
    for (const double r : bed.state.r) weight += mass(s, r) * s.gravity;
    State now = bed.state;
    Loads loads;
    for (int rests = 0; rests == 0 || (rests < 5 && bound > 0.02 * weight); ++rests) {  // until it is at rest
      now = run(*engine, s, now, 15000);
      loads = loads_of(s, now);
      double mean_force = 0;
      for (const ContactForce& c : loads.contacts) mean_force += length(c.f_n) / loads.contacts.size();
      bound = observe(s, now, loads).unbalanced_force * mean_force * now.size();
    }
    ASSERT_LT(bound, 0.02 * weight);
    const Borne b = borne(loads);
    std::printf("mu %.1f: floor %.5f, side walls %.5f of the weight; bound %.1e\n", mu, b.floor / weight,
                b.friction / weight, bound / weight);
    EXPECT_NEAR(b.floor + b.friction, weight, bound);
    double on_grains = 0;  // among themselves they press nobody down; loads have speeds half a step later
    for (const Vec3d& f : now.force) on_grains += f.z;
    EXPECT_NEAR((b.floor + b.friction) / on_grains, 1, 1e-6);
    EXPECT_LT(length(b.sideways), bound);
    EXPECT_NEAR(observe(s, now, loads).normal_stress * s.area() / b.floor, 1, 1e-12);
    if (mu == 0) {
      EXPECT_EQ(b.friction, 0);
    } else {
      EXPECT_GT(b.friction, 0.1 * weight);  // nearly three widths high
    }
    for (Index i = 0; i < now.size(); ++i)
      for (int a = 0; a < 2; ++a) {
        EXPECT_GT(now.x[i][a], 0.99 * now.r[i]);
        EXPECT_LT(now.x[i][a], s.box[a] - 0.99 * now.r[i]);
      }
  }
}

// A row of n grains between two walls, one of which moves slowly: n + 1 springs above one another take
// k u^2/(2 (n + 1)). The row swings by v sqrt(m/k) (n + 1)/u of that.
TEST_P(SideWall, ThatMovesDoesWork) {
  const auto engine = make();
  const double k = 1e5, u = 1e-4;
  const int n = 5;
  for (const BodyId moves : sides) {
    const int axis = moves == BodyId::y_low || moves == BodyId::y_high ? 1 : 0;
    const bool high = moves == BodyId::x_high || moves == BodyId::y_high;
    Scene s = empty_space(k);
    s.contact.fill(LinearContact{k, 0, 0, 0, 0, 0});
    s.box[axis] = 2 * R * n;
    put_side_walls(s);
    const double w = std::sqrt(k / mass(s, R)), v = u * w / (1000 * (n + 1));
    s.dt = 0.05 / w;
    s.body(moves).along(axis) = Drive::at(high ? -v : v);
    std::vector<Vec3d> x(n, {0.5, 0.5, 0.5});
    for (int i = 0; i < n; ++i) x[i][axis] = (2 * i + 1) * R;
    State start = grains_at_rest(std::vector<double>(n, R), x);
    if (high) start.at(moves).x[axis] = s.box[axis];
    engine->load(s, start);
    const auto steps = std::llround(u / v / s.dt);
    double by_hand = 0;
    State before = engine->state();
    for (std::int64_t step = 0; step < steps; ++step) {
      engine->advance(1);
      State now = engine->state();
      by_hand -= 0.5 * (before.at(moves).force[axis] + now.at(moves).force[axis]) *
                 (now.at(moves).x[axis] - before.at(moves).x[axis]);
      before = std::move(now);
    }
    const State now = engine->state();
    const double work = now.ledger.planes, stored = observe(s, now).energy.total();
    EXPECT_NEAR(std::abs(now.at(moves).x[axis] - (high ? s.box[axis] : 0)) / u, 1, 1e-4) << name_of(moves);
    EXPECT_NEAR(work / (k * u * u / (2 * (n + 1))), 1, 1e-3) << name_of(moves);
    EXPECT_NEAR(by_hand / work, 1, 1e-9) << name_of(moves);  // places of 0.1 m, ways of 1e-9 m
    EXPECT_NEAR(stored / work, 1, 1e-6) << name_of(moves);   // contacts do not open
    EXPECT_EQ(now.ledger.slip + now.ledger.viscous + now.ledger.layers, 0);
  }
}

ON_EVERY_BACKEND(SideWall);

}  // namespace
}  // namespace moraine::dem
