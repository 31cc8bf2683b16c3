// Every joule of a sheared bed is accounted for.
#include "backends.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

double balance(const Scene& scene, const State& s) {
  const Ledger& l = s.ledger;
  return observe(scene, s).energy.total() + l.slip + l.viscous - l.planes - l.layers;
}

struct Variant {
  const char* name;
  Bed bed;
  int longer = 1;  // so many times as many steps, where they are short
};
std::vector<Variant> variants() {
  std::vector<Variant> all(5, {"slip, damped walls", sheared_bed()});
  const auto grain_of = [&](int k) -> ContactParameters& { return all[k].bed.scene.with(Material::grain); };
  all[1].name = "damped grains", grain_of(1).gamma_n = grain_of(1).gamma_t = 5;
  all[2].name = "softening", grain_of(2).mu_d = 0.3;
  all[3].name = "layer driven by stress", drive_top_layer(all[3].bed.scene, Drive::by(200));
  Bed& smooth = all[4].bed;
  all[4].name = "no friction, no damping";
  smooth.scene.contact.fill(LinearContact{1e5, 0, 0, 0, 0, 0});
  for (Contact& c : smooth.state.contacts) c.spring.delta_t = {0, 0, 0};
  for (WallContact& c : smooth.state.wall_contacts) c.spring.delta_t = {0, 0, 0};
  all.push_back({"a side wall moves in", squeezed_bed()});
  all.push_back({"layer and a mass on it, driven by stress", sheared_bed()});
  drive_top_layer(all.back().bed.scene, Drive::by(200));
  all.back().bed.scene.body(BodyId::top_layer).mass = 10;  // kg, tens of times the layer's grains
  all.push_back({"sheared along side walls", sheared_between_walls()});
  all.push_back({"density scaling", sheared_bed()});
  Bed& scaled = all.back().bed;  // half the grains
  std::vector<double> r = scaled.state.r;
  std::nth_element(r.begin(), r.begin() + r.size() / 2, r.end());
  scaled.scene.least_inertia = 1.2 * r[r.size() / 2];
  all.push_back({"sizes 1:20", sheared_graded_bed(), 10});
  all.push_back({"sizes 1:20, damped", sheared_graded_bed(), 10});
  all.back().bed.scene.with(Material::grain).gamma_n = all.back().bed.scene.with(Material::grain).gamma_t =
      0.2;
  const auto add = [&](const char* name, auto&& change, int longer = 1) {
    all.push_back({name, sheared_bed(), longer});
    change(all.back().bed.scene);
  };
  add("Hertz and Mindlin", [](Scene& s) { use_hertz(s); });
  add("Hertz and Mindlin, restitution", [](Scene& s) { use_hertz(s, 0.5); });
  add("restitution", [](Scene& s) {
    for (ContactParameters& p : s.contact) p.zeta = damping_ratio(0.5);
  });
  add("rolling", [](Scene& s) { resist_rolling(s); });
  add("rolling and twisting", [](Scene& s) { resist_rolling(s, 0.2, 0.1); });
  add("cohesion", [](Scene& s) { cohere(s, 0.05); });
  add("every law", [](Scene& s) { use_every_law(s); });
  all.push_back({"a velocity that changes, with a profile", sheared_bed()});
  drive_top_layer(all.back().bed.scene, changing_velocity());
  all.push_back({"stresses that change, on a slope", sheared_bed()});
  drive_top_layer(all.back().bed.scene, changing_stress());
  all.back().bed.scene.body(BodyId::top_wall).z.rate = 2e4;
  all.back().bed.scene.down = {std::sin(0.1), 0, -std::cos(0.1)};
  return all;
}

struct Residue {
  double largest, turnover;  // J; turnover: what the drives gave and the contacts took
};
// 400 steps of the bed's own dt, in which the layer drives the whole bed to slip.
Residue residue(Engine& engine, const Variant& v, int finer) {
  Bed bed = v.bed;
  bed.scene.dt /= finer;
  engine.load(bed.scene, bed.state);
  const double start = balance(bed.scene, engine.state());
  Residue out{};
  for (int k = 0; k < 20; ++k) {
    engine.advance(20 * finer * v.longer);
    const State now = engine.state();
    const Ledger& l = now.ledger;
    out.largest = std::max(out.largest, std::abs(balance(bed.scene, now) - start));
    out.turnover = l.slip + l.viscous + std::abs(l.planes) + std::abs(l.layers);
  }
  return out;
}

class EnergyLedger : public OnEveryBackend {};

// Contacts open and close between steps: (w dt)^2 = 0.01 at dt = 0.1/w, of the energy that each held.
TEST_P(EnergyLedger, Balances) {
  const auto engine = make();
  for (const Variant& v : variants()) {
    const Residue r = residue(*engine, v, 1);
    EXPECT_LT(r.largest, 5e-4 * r.turnover) << v.name;
  }
}
ON_EVERY_BACKEND(EnergyLedger);

// Second order, as the scheme is. Which contacts slip when differs from one dt to the next, so single slopes
// scatter; the mean over four halvings is held to 0.2.
TEST(EnergyLedgerOrder, Two) {
  const auto engine = make_engine(Backend::cpu, 1);
  for (const Variant& v : variants()) {
    const double coarse = residue(*engine, v, 1).largest, fine = residue(*engine, v, 16).largest;
    EXPECT_NEAR(std::log2(coarse / fine) / 4, 2, 0.2) << v.name;
  }
}

}  // namespace
}  // namespace moraine::dem
