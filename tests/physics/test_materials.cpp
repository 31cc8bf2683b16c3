// Beds of grains of two and three materials, each pair with parameters of its own.
#include "backends.hpp"
#include "dem/grain.hpp"
#include "physics/materials.hpp"
#include "physics/same_bits.hpp"

namespace moraine::dem {
namespace {

const ContactParameters& between(const Scene& s, const State& at, Index i, Index j) {
  return s.between(at.material_of(i), at.material_of(j));
}

struct Mixture {
  const char* name;
  Bed bed;
};
const std::vector<Mixture>& mixtures() {
  static const std::vector<Mixture> all = [] {
    std::vector<Mixture> a{{"two materials", of_materials(sheared_bed(), 2)},
                           {"three, unlike laws", of_unlike_laws(sheared_bed(), 3)},
                           {"three, damped, no ledger", of_materials(sheared_bed(), 3)},
                           {"four, a cloud", of_unlike_laws(cloud(700, 0.2, 5), 4)},
                           {"two, sizes 1:20", of_unlike_laws(sheared_graded_bed(), 2)}};
    Scene& damped = a[2].bed.scene;
    for (ContactParameters& p : damped.contact) p.gamma_n = p.gamma_t = 5;
    damped.ledger = false;
    return a;
  }();
  return all;
}
constexpr std::int64_t steps = 400;
State one_thread(const Bed& bed) { return run(*make_engine(Backend::cpu, 1), bed.scene, bed.state, steps); }

class Materials : public OnEveryBackend {};

TEST_P(Materials, SameBits) {
  for (const Mixture& m : mixtures()) {
    SCOPED_TRACE(m.name);
    expect_same_bits(run(*make(), m.bed.scene, m.bed.state, steps), one_thread(m.bed));
  }
}

// A new engine takes the state on; neighbour lists of another margin change nothing either.
TEST_P(Materials, RestartAndMargin) {
  for (const Mixture& m : mixtures()) {
    SCOPED_TRACE(m.name);
    const State whole = run(*make(), m.bed.scene, m.bed.state, steps);
    const State part = run(*make(), m.bed.scene, m.bed.state, steps / 3);
    EXPECT_EQ(part.material, m.bed.state.material);
    expect_same_bits(run(*make(), m.bed.scene, part, steps - steps / 3), whole);
    Scene s = m.bed.scene;
    s.neighbour_margin = 0.03 * m.bed.state.r[0];
    expect_same_bits(run(*make(), s, m.bed.state, steps), whole);
  }
}

// Grains of materials that are alike move as those of one do, but for what the order of sums rounds.
TEST_P(Materials, AlikeIsOne) {
  const Bed one = cloud(300, 0.15, 8);
  Bed alike = one;
  alike.scene.materials = 3;
  for (const Index id : one.state.id) alike.state.material.push_back(Material(id % 3));
  const State a = run(*make(), one.scene, one.state, 200), b = run(*make(), alike.scene, alike.state, 200);
  for (Index i = 0; i < a.size(); ++i) EXPECT_LT(length(a.x[i] - b.x[i]), 1e-12);
}

// The forces of a cloud against those of all pairs, each with its own parameters.
TEST_P(Materials, ForcesOfAllPairs) {
  const Bed bed = of_unlike_laws(cloud(190, 0.13, 5), 4);
  const Scene& s = bed.scene;
  const auto engine = make();
  engine->load(s, bed.state);
  const State now = engine->state(), &at = bed.state;
  const Sides sides = Sides::of(s);
  std::vector<Vec3d> force(now.size(), Vec3d{0, 0, 0});
  double largest = 0;
  std::vector<std::pair<Material, Material>> met;
  for (Index i = 0; i < now.size(); ++i)
    for (Index j = i + 1; j < now.size(); ++j) {
      const Vec3d x = nearest_image(sides, now.x[i] - now.x[j]);
      const auto g = between_grains(x, now.r[i] + now.r[j], now.r[i] - now.r[j]);
      if (!(g.delta_n < 0)) continue;
      met.push_back({at.material_of(i), at.material_of(j)});
      Spring<double> spring;
      const Vec3d f =
          contact_law<Linear<SofteningCoulomb, Viscosity>, Account::energy>(
              between(s, at, i, j), 0, g, Motion<double>{at.v[i] - at.v[j], at.omega[i], at.omega[j]}, spring)
              .f;
      force[i] += f, force[j] -= f;
      largest = std::max(largest, length(f));
    }
  std::ranges::sort(met);
  met.erase(std::ranges::unique(met).begin(), met.end());
  EXPECT_GT(met.size(), 8u);
  for (Index i = 0; i < now.size(); ++i) EXPECT_LT(length(now.force[i] - force[i]), 1e-13 * largest);
}

// m v(n-1/2) of the whole is kept exactly, but for rounding.
TEST_P(Materials, Momentum) {
  const Bed bed = of_unlike_laws(cloud(190, 0.13, 6), 3);
  const auto engine = make();
  const auto momentum = [&](const State& s) {
    Vec3d p{0, 0, 0};
    for (Index i = 0; i < s.size(); ++i) p += bed.scene.inertial_mass(s.r[i], s.material_of(i)) * s.v[i];
    return p;
  };
  double scale = 0;
  for (Index i = 0; i < bed.state.size(); ++i)
    scale += bed.scene.inertial_mass(bed.state.r[i], bed.state.material_of(i)) * length(bed.state.v[i]);
  engine->load(bed.scene, bed.state);
  const Vec3d before = momentum(engine->state());
  engine->advance(1000);
  EXPECT_LT(length(momentum(engine->state()) - before), 1e-12 * scale);
}

// Two grains of unlike mass meet head on: half a swing with w^2 = k (1/m_1 + 1/m_2), then they part with
// their relative velocity turned round. Leapfrog lengthens the swing by (w dt)^2/24 and leaves the
// velocities.
TEST_P(Materials, TwoGrainsMeet) {
  Bed bed{empty_space(1e5), grains_at_rest({0.01, 0.01}, {{0.49, 0.5, 0.5}, {0.51, 0.5, 0.5}})};
  Scene& s = bed.scene;
  s.materials = 2, s.density[1] = 7800;
  s.between(Material::grain, Material::grain_2).k_n = s.between(Material::grain_2, Material::grain).k_n = 3e5;
  bed.state.material = {Material::grain, Material::grain_2};
  const double u = 0.1, m1 = s.inertial_mass(0.01, Material::grain),
               m2 = s.inertial_mass(0.01, Material::grain_2);
  EXPECT_DOUBLE_EQ(m2, 3 * m1);
  const double w = std::sqrt(3e5 * (1 / m1 + 1 / m2)), dt = 0.01 / w;
  s.dt = dt;
  bed.state.v[0].x = u;
  const auto engine = make();
  engine->load(s, bed.state);
  engine->advance(157);  // a quarter of a swing
  const State deepest = engine->state();
  EXPECT_NEAR(0.02 - (deepest.x[1].x - deepest.x[0].x), u / w, 2e-5 * u / w);
  engine->advance(200);
  const State end = engine->state();
  EXPECT_NEAR(end.v[0].x, (m1 - m2) / (m1 + m2) * u, 2e-5 * u);
  EXPECT_NEAR(end.v[1].x, 2 * m1 / (m1 + m2) * u, 2e-5 * u);
}

// Under water each sinks or rises by its own density; large ones that density scaling slows do, too.
TEST_P(Materials, Buoyancy) {
  Bed bed{empty_space(1e5),
          grains_at_rest({0.01, 0.01, 0.01}, {{0.2, 0.5, 0.5}, {0.5, 0.5, 0.5}, {0.8, 0.5, 0.5}})};
  Scene& s = bed.scene;
  s.gravity = 9.81, s.fluid_density = 1000, s.materials = 3, s.density = {2600, 800, 1000, 0}, s.dt = 1e-4;
  bed.state.material = {Material::grain, Material::grain_2, Material::grain_3};
  for (const double wide : {0.0, 0.02}) {
    s.least_inertia = wide;
    const State end = run(*make(), s, bed.state, 1000);
    const double scaled = wide > 0 ? 0.125 : 1;
    for (const auto& [i, rho] : {std::pair{0, 2600.0}, {1, 800.0}, {2, 1000.0}})
      EXPECT_NEAR(end.x[i].z - 0.5, -scaled * 0.5 * 9.81 * (1 - 1000 / rho) * 0.01, 1e-12);
  }
}

// A row of grains that a layer draws over others: each contact slides at the friction of its own pair.
TEST_P(Materials, SlidesAtThePairsFriction) {
  const double r = 0.01, sunk = 1e-5;
  std::vector<Vec3d> x;
  for (int k = 0; k < 3; ++k)
    for (const double z : {r, 3 * r - sunk}) x.push_back({0.1 + 0.1 * k, 0.5, z});
  Bed bed{empty_space(1e5), grains_at_rest(std::vector<double>(6, r), x)};
  Scene& s = bed.scene;
  State& at = bed.state;
  s.materials = 2, s.dt = 1e-5;
  const auto friction = [&](Material a, Material b, double mu) {
    for (ContactParameters* p : {&s.between(a, b), &s.between(b, a)}) p->mu_s = p->mu_d = mu;
  };
  friction(Material::grain, Material::grain, 0.2), friction(Material::grain_2, Material::grain_2, 0.6);
  friction(Material::grain, Material::grain_2, 0.35);
  at.material = {Material::grain,   Material::grain,   Material::grain_2,
                 Material::grain_2, Material::grain_2, Material::grain};
  drive_top_layer(s, Drive::at(0.05));
  s.body(BodyId::bottom_layer) = layer({}, true);
  s.body(BodyId::top_wall) = wall_at_rest(), at.wall_z() = 4 * r - sunk;
  for (int m = 0; m < 2; ++m)
    s.between(Material(m), Material::wall).mu_s = s.between(Material(m), Material::wall).mu_d = 0;
  for (Index i = 0; i < 6; ++i) at.part_of[i] = i % 2 == 0 ? BodyId::bottom_layer : BodyId::top_layer;
  const State end = run(*make(), s, at, 500);  // 0.25 mm on
  const std::vector<ContactForce> f = contact_forces(s, end);
  ASSERT_EQ(f.size(), 3u);
  const double mu[] = {0.2, 0.6, 0.35};
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(f[k].i, static_cast<Index>(2 * k));
    EXPECT_NEAR(length(f[k].f_t) / length(f[k].f_n), mu[k], 1e-12);
  }
}

ON_EVERY_BACKEND(Materials);

TEST(MaterialThreads, OneToFour) {
  for (const Mixture& m : mixtures()) {
    SCOPED_TRACE(m.name);
    for (const int threads : {2, 3, 4})
      expect_same_bits(run(*make_engine(Backend::cpu, threads), m.bed.scene, m.bed.state, steps),
                       one_thread(m.bed));
  }
}

// As EnergyLedger has it for one material (test_energy_ledger.cpp).
TEST(MaterialLedger, SecondOrder) {
  for (const int count : {2, 3}) {
    const Bed start = count == 2 ? of_materials(sheared_bed(), 2) : of_unlike_laws(sheared_bed(), 3);
    const auto residue = [&](int finer) {
      Bed bed = start;
      bed.scene.dt /= finer;
      const auto balance = [&](const State& s) {
        const Ledger& l = s.ledger;
        return observe(bed.scene, s).energy.total() + l.slip + l.viscous - l.planes - l.layers;
      };
      const auto engine = make_engine(Backend::cpu, 1);
      engine->load(bed.scene, bed.state);
      const double before = balance(engine->state());
      double largest = 0, turnover = 0;
      for (int k = 0; k < 20; ++k) {
        engine->advance(20 * finer);
        const State now = engine->state();
        largest = std::max(largest, std::abs(balance(now) - before));
        turnover =
            now.ledger.slip + now.ledger.viscous + std::abs(now.ledger.planes) + std::abs(now.ledger.layers);
      }
      EXPECT_LT(largest, 5e-4 * turnover / finer / finer * 4);
      return largest;
    };
    EXPECT_NEAR(std::log2(residue(1) / residue(16)) / 4, 2, 0.2) << count;
  }
}

}  // namespace
}  // namespace moraine::dem
