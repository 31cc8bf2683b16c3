// The eight tests of a single contact of Chung and Ooi (2011), "Benchmark tests for verifying discrete
// element modelling codes at particle impact level", Granular Matter 13, 643-656, with Hertz and Mindlin's
// law. Materials and speeds are theirs. What is compared with:
//   Hertz's closed form (tests 1 and 2), the restitution asked for (3), impulses in Coulomb's ratio (4 to 6
//   and 8 where they slide throughout), symmetry (7);
//   one_impact.hpp, the same equations integrated apart from the program, where contacts stick (4 to 6, 8);
//   figures of the paper, read off by eye (the numbers are those that Kratos Multiphysics keeps in its
//   DEMApplication/tests/DEM3D_chung_ooi_tests, BSD licence), to what reading them costs.
// The paper's own law holds its spring's force while a contact opens and damps across, too: its curves are
// compared where that is no matter.
#include "backends.hpp"
#include "dem/law/hertz.hpp"
#include "dem/law/restitution.hpp"
#include "physics/one_impact.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

struct Stuff {
  double young, poisson, density;  // Pa, 1, kg/m3
};
constexpr Stuff glass{4.8e10, 0.20, 2800}, limestone{2.0e10, 0.25, 2500};
constexpr Stuff aluminium_alloy_2{7.0e10, 0.30, 2699}, magnesium_alloy{4.0e10, 0.35, 1800};  // test 2
constexpr Stuff aluminium_oxide{3.8e11, 0.23, 4000}, cast_iron{1.0e11, 0.25, 7000};
constexpr Stuff aluminium_alloy{7.0e10, 0.33, 2700}, copper{1.2e11, 0.35, 8900}, nylon{2.5e9, 0.40, 1000};
constexpr Stuff steel{2.08e11, 0.30, 7850}, polyethylene{1.0e9, 0.40, 1400};
constexpr double rigid = 1e12;  // times as stiff and as heavy

constexpr double degree = std::numbers::pi / 180;
constexpr int steps_a_contact = 2000;
// The scheme is of second order in dt, and Hertz's force begins smoothly enough for that. Damping begins as
// the fourth root of the overlap, and a contact that sticks first slips: both cost a little more.
constexpr double second_order = 4e-6, damped = 4e-5;
constexpr double sheared = 2e-5;  // of the speed
constexpr double sliding = 4e-6;  // impulses are in Coulomb's ratio once the spring is loaded

ContactParameters law(const Stuff& i, const Stuff& j, double mu, double e) {
  ContactParameters p;
  p.k_n = p.k_t = 0;
  p.E_star = young_star(i.young, i.poisson, j.young, j.poisson);
  p.G_star = shear_star(i.young, i.poisson, j.young, j.poisson);
  p.zeta = damping_ratio(e), p.density_i = i.density, p.density_j = j.density;
  p.mu_s = p.mu_d = mu;
  return p;
}
Stuff stiff(const Stuff& s) { return {rigid * s.young, s.poisson, rigid * s.density}; }

// A sphere over a plane that does not yield, or (r_j > 0) under a sphere that neither yields nor moves.
struct OnRigid {
  Scene scene;
  Impact impact;
  std::string about;

  OnRigid(const Stuff& stuff, double r, double mu, double e, double v_n, double v_t, double spin,
          double r_j = 0) {
    const ContactParameters p = law(stuff, stiff(stuff), mu, e);
    impact = {.r = r,
              .mass = sphere_mass(stuff.density, r),
              .r_j = r_j,
              .e_star = p.E_star,
              .g_star = p.G_star,
              .zeta = p.zeta,
              .mu = mu,
              .v_n = v_n,
              .v_t = v_t,
              .spin = spin};
    scene = empty_space(0);
    scene.box = 40.0 * Vec3d{r + r_j, r + r_j, r + r_j};
    scene.density.fill(stuff.density);
    scene.contact.fill(p);
    scene.dt = impact.duration() / steps_a_contact;
    if (r_j > 0)
      scene.body(BodyId::bottom_layer) = layer({}, true);
    else
      scene.body(BodyId::floor) = floor_at(0);
    about = "v_n = " + std::to_string(v_n) + ", v_t = " + std::to_string(v_t) + " m/s, spin " +
            std::to_string(spin) + " rad/s";
  }

  // Along an oblique direction in the plane. Contact begins between two steps.
  Rebound rebound(Engine& engine) const {
    const Vec3d along{0.6, 0.8, 0}, axis{-0.8, 0.6, 0}, middle{0.5 * scene.box.x, 0.5 * scene.box.y, 0};
    const double height = impact.r + impact.r_j + 0.5 * impact.v_n * scene.dt;
    State now = grains_at_rest({impact.r}, {middle + Vec3d{0, 0, height}});
    if (impact.r_j > 0) {
      const Vec3d held = middle + Vec3d{0, 0, 4 * impact.r_j};
      now = grains_at_rest({impact.r, impact.r_j}, {held + Vec3d{0, 0, height}, held});
      now.part_of[1] = BodyId::bottom_layer;
    }
    now.v[0] = impact.v_t * along - Vec3d{0, 0, impact.v_n}, now.omega[0] = impact.spin * axis;
    now = run(engine, scene, now, 3 * steps_a_contact);
    EXPECT_TRUE(now.contacts.empty() && now.wall_contacts.empty()) << about;
    EXPECT_NEAR(dot(now.v[0], axis), 0, 1e-12 * impact.v_n) << about;
    EXPECT_NEAR(dot(now.omega[0], along), 0, 1e-12 * impact.v_n / impact.r) << about;
    return {now.v[0].z, dot(now.v[0], along), dot(now.omega[0], axis)};
  }
};

class ChungOoi : public OnEveryBackend {};

// Test 1: two like spheres, r = 10 mm, at 10 m/s each.
TEST_P(ChungOoi, Test1ElasticNormalImpactOfTwoSpheres) {
  const auto engine = make();
  for (const Stuff& stuff : {glass, limestone}) {
    const double r = 0.010, v = 10;
    Scene s = empty_space(0);
    s.density.fill(stuff.density);
    s.contact.fill(law(stuff, stuff, 0.35, 1));
    const double m = mass(s, r);
    const Impact reduced{
        .r = 0.5 * r, .mass = 0.5 * m, .e_star = s.with(Material::grain).E_star, .g_star = 0, .v_n = 2 * v};
    s.dt = reduced.duration() / steps_a_contact;
    State now = grains_at_rest({r, r}, {{0.3, 0.4, 0.5}, {0.3 + 2 * r + v * s.dt, 0.4, 0.5}});
    now.v[0].x = v, now.v[1].x = -v;
    engine->load(s, now);
    double force = 0, overlap = 0, touching = 0;
    for (int step = 0; step < 1.1 * steps_a_contact; ++step) {
      engine->advance(1);
      now = engine->state();
      force = std::max(force, -now.force[0].x),
      overlap = std::max(overlap, 2 * r - (now.x[1].x - now.x[0].x));
      touching += now.contacts.empty() ? 0 : 1;
    }
    EXPECT_NEAR(force / reduced.greatest_force(), 1, second_order);
    EXPECT_NEAR(overlap / reduced.greatest_overlap(), 1, second_order);
    EXPECT_NEAR(touching / steps_a_contact, 1, 1.0 / steps_a_contact);
    EXPECT_NEAR(now.v[0].x / v, -1, second_order);
    EXPECT_NEAR(now.v[1].x / v, 1, second_order);
    if (stuff.young == glass.young) {  // figures of the paper
      EXPECT_NEAR(force, 10.70e3, 0.01 * 10.70e3);
      EXPECT_NEAR(touching * s.dt, 40.5e-6, 0.01 * 40.5e-6);
    }
  }
}

// Test 2: a sphere, r = 100 mm, at 0.2 m/s on a rigid plane.
TEST_P(ChungOoi, Test2ElasticNormalImpactOnAPlane) {
  const auto engine = make();
  for (const Stuff& stuff : {aluminium_alloy_2, magnesium_alloy}) {
    const OnRigid c(stuff, 0.1, 0, 1, 0.2, 0, 0);
    State now = grains_at_rest({0.1}, {{1, 1, 0.1 + 0.1 * c.scene.dt}});
    now.v[0].z = -0.2;
    engine->load(c.scene, now);
    double force = 0, overlap = 0, touching = 0;
    for (int step = 0; step < 1.1 * steps_a_contact; ++step) {
      engine->advance(1);
      now = engine->state();
      force = std::max(force, now.force[0].z), overlap = std::max(overlap, 0.1 - now.x[0].z);
      touching += now.force[0].z > 0 ? 1 : 0;
    }
    EXPECT_NEAR(force / c.impact.greatest_force(), 1, second_order);
    EXPECT_NEAR(overlap / c.impact.greatest_overlap(), 1, second_order);
    EXPECT_NEAR(touching / steps_a_contact, 1, 1.0 / steps_a_contact);
    EXPECT_NEAR(now.v[0].z / 0.2, 1, second_order);
    if (stuff.young == aluminium_alloy_2.young) {  // figures of the paper
      EXPECT_NEAR(force, 11.36e3, 0.01 * 11.36e3);
      EXPECT_NEAR(touching * c.scene.dt, 728e-6, 0.01 * 728e-6);
    }
  }
}

// Test 3: r = 2.5 mm at 3.9 m/s on a rigid plane; the restitution is what was asked for.
TEST_P(ChungOoi, Test3NormalImpactWithRestitution) {
  const auto engine = make();
  for (const Stuff& stuff : {aluminium_oxide, cast_iron})
    for (const double e : {0.2, 0.4, 0.6, 0.8, 1.0}) {
      const OnRigid c(stuff, 0.0025, 0, e, 3.9, 0, 0);
      EXPECT_NEAR(c.rebound(*engine).v_n / 3.9, e, damped) << "e = " << e;
    }
}

// Test 4: r = 2.5 mm at 3.9 m/s on a rigid plane, at 5 to 85 degrees from its normal; e = 0.98, mu = 0.092.
TEST_P(ChungOoi, Test4ObliqueImpactAtOneSpeed) {
  const auto engine = make();
  const double v = 3.9, r = 0.0025, mu = 0.092, e = 0.98;
  // Tangential restitution of aluminium oxide: at angles, degrees; below 15 degrees the paper's law counts.
  const std::vector<std::pair<double, double>> figure{{15, 0.624}, {20, 0.616}, {25, 0.634}, {30, 0.684},
                                                      {35, 0.737}, {40, 0.781}, {50, 0.845}, {60, 0.893},
                                                      {70, 0.932}, {80, 0.966}, {85, 0.983}};
  for (const Stuff& stuff : {aluminium_oxide, aluminium_alloy})
    for (int angle = 5; angle <= 85; angle += 5) {
      const double v_n = v * std::cos(angle * degree), v_t = v * std::sin(angle * degree);
      const OnRigid c(stuff, r, mu, e, v_n, v_t, 0);
      const Rebound got = c.rebound(*engine), known = exact(c.impact);
      EXPECT_NEAR(got.v_n / v_n, e, damped) << c.about;
      EXPECT_NEAR(got.v_t, known.v_t, sheared * v) << c.about;
      EXPECT_NEAR(r * got.spin, r * known.spin, sheared * v) << c.about;
      if (angle >= 40) {  // slides throughout; its lever arm is shorter than r by half the overlap
        EXPECT_NEAR(got.v_t / v_t, 1 - mu * (1 + got.v_n / v_n) / std::tan(angle * degree), sliding)
            << c.about;
        EXPECT_NEAR(got.spin / (2.5 * mu * (1 + e) * v_n / r), 1, c.impact.greatest_overlap() / r) << c.about;
      }
      if (stuff.young == aluminium_oxide.young)
        for (const auto& [at, e_t] : figure)
          if (at == angle) {
            EXPECT_NEAR(got.v_t / v_t, e_t, 0.01) << c.about;
          }
    }
}

// Test 5: r = 0.01 mm at 5 m/s along the normal of a rigid plane, across at up to 100 m/s; e = 1, mu = 0.3.
TEST_P(ChungOoi, Test5ObliqueImpactAtOneNormalSpeed) {
  const auto engine = make();
  const double v_n = 5, r = 1e-5, mu = 0.3;
  // Steel, finite elements of Wu et al. (2003) in the paper's figure: -r spin/(mu v_n) at v_t/(mu v_n). Their
  // contact slips at its rim before it slips as a whole, which no spring does.
  const std::vector<std::pair<double, double>> elements{{0.318, 0.187}, {0.890, 0.665}, {1.53, 1.355},
                                                        {2.28, 2.32},   {3.30, 3.44},   {4.69, 4.57},
                                                        {5.66, 4.94},   {7.03, 4.94},   {18.8, 4.97}};
  for (const Stuff& stuff : {steel, polyethylene})
    for (const double x : {0.06, 0.318, 0.890, 1.53, 2.28, 3.30, 4.69, 5.66, 7.03, 10.0, 18.8}) {
      const OnRigid c(stuff, r, mu, 1, v_n, x * mu * v_n, 0);
      const Rebound got = c.rebound(*engine), known = exact(c.impact);
      EXPECT_NEAR(got.v_n / v_n, 1, second_order) << c.about;
      EXPECT_NEAR(got.v_t, known.v_t, sheared * v_n) << c.about;
      EXPECT_NEAR(r * got.spin, r * known.spin, sheared * v_n) << c.about;
      if (x > 7) {
        EXPECT_NEAR((x * mu * v_n - got.v_t) / (mu * v_n), 1 + got.v_n / v_n, sliding) << c.about;
        EXPECT_NEAR(r * got.spin / (mu * v_n), 5, 5 * c.impact.greatest_overlap() / r) << c.about;
      }
      if (stuff.young == steel.young)
        for (const auto& [at, spin] : elements)
          if (at == x) {
            EXPECT_NEAR(r * got.spin / (mu * v_n), spin, 0.45) << c.about;
          }
    }
}

// Tests 6 and 8: r = 100 mm at 0.2 m/s, with spin, onto a rigid plane and onto a sphere five times as large,
// 1000 times as dense and stiff (case A), here held. mu = 0.4, e = 0.5. beta is the tangential restitution of
// the contact point; published at 7/2 mu (1 + e) v_n/v_t.
void spinning(Engine& engine, double r_j, const std::vector<std::pair<double, double>>& published) {
  const double v_n = 0.2, r = 0.1, mu = 0.4, e = 0.5;
  for (const Stuff& stuff : {aluminium_alloy, nylon})
    for (const double tangent : {0.0875, 0.364, 0.577, 1.0, 1.43, 1.73, 2.14, 2.75, 3.73, 5.67, 11.4}) {
      const OnRigid c(stuff, r, mu, e, v_n, 0, -tangent * v_n / r, r_j);
      const Rebound got = c.rebound(engine), known = exact(c.impact);
      const double v_st = tangent * v_n, beta = -(got.v_t - r * got.spin) / v_st,
                   x = 3.5 * mu * (1 + e) / tangent;
      EXPECT_NEAR(got.v_n / known.v_n, 1, damped) << c.about;
      EXPECT_NEAR(got.v_t, known.v_t, sheared * v_n) << c.about;
      EXPECT_NEAR(r * got.spin, r * known.spin, sheared * v_n) << c.about;
      if (x < 0.95) {
        // Damping presses before the spring is loaded, so that the contact sticks at first.
        EXPECT_NEAR(beta, x - 1, 0.03 * x * x + c.impact.greatest_overlap() / r) << c.about;
        for (const auto& [at, value] : published)
          if (std::abs(at - x) < 0.01) {
            EXPECT_NEAR(beta, value + (x - at), 0.025) << c.about;
          }
      }
    }
}
TEST_P(ChungOoi, Test6SpinningImpactOnAPlane) {
  spinning(*make(), 0, {{0.187, -0.815}, {0.358, -0.626}, {0.551, -0.439}, {0.765, -0.238}});
}

// Test 7: two like spheres, r = 100 mm, at 0.2 m/s each and with opposite spins: their surfaces run alike.
TEST_P(ChungOoi, Test7LikeSpheresWithOppositeSpins) {
  const auto engine = make();
  for (const Stuff& stuff : {aluminium_alloy, copper})
    for (const double spin : {0.175, 2.0, 22.9}) {
      const double r = 0.1, v = 0.2, e = 0.5;
      Scene s = empty_space(0);
      s.density.fill(stuff.density);
      s.contact.fill(law(stuff, stuff, 0.4, e));
      const Impact reduced{.r = 0.5 * r,
                           .mass = 0.5 * mass(s, r),
                           .e_star = s.with(Material::grain).E_star,
                           .g_star = 0,
                           .v_n = 2 * v};
      s.dt = reduced.duration() / steps_a_contact;
      State now = grains_at_rest({r, r}, {{0.3, 0.4, 0.5}, {0.3 + 2 * r + v * s.dt, 0.4, 0.5}});
      now.v = {{v, 0, 0}, {-v, 0, 0}}, now.omega = {{0, spin, 0}, {0, -spin, 0}};
      now = run(*engine, s, now, 3 * steps_a_contact);
      for (const int i : {0, 1}) {
        const double sign = i == 0 ? 1 : -1;
        EXPECT_NEAR(now.omega[i].y, sign * spin, 1e-12 * spin);
        EXPECT_NEAR(now.v[i].z, 0, 1e-12 * v);
        EXPECT_NEAR(now.v[i].x / v, -sign * e, damped);
      }
    }
}

TEST_P(ChungOoi, Test8SpinningImpactOnALargerSphere) {
  spinning(*make(), 0.5, {{0.187, -0.815}, {0.358, -0.626}, {0.551, -0.439}, {0.765, -0.238}});
}

ON_EVERY_BACKEND(ChungOoi);

}  // namespace
}  // namespace moraine::dem
