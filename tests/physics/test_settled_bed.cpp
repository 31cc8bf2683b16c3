// A bed at rest under its own weight.
#include "backends.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

class SettledBed : public OnEveryBackend {};

TEST_P(SettledBed, StressIsWeight) {
  const Bed& bed = settled_bed();
  const Scene& s = bed.scene;
  const auto engine = make();
  const State now = run(*engine, s, bed.state, 2000);
  const Observation o = observe(s, now);
  double weight = 0, top = 0;
  for (Index i = 0; i < now.size(); ++i)
    weight += mass(s, now.r[i]) * s.gravity, top = std::max(top, now.x[i].z);
  ASSERT_LT(o.unbalanced_force, 1e-3);  // what still moves sets the bounds below
  EXPECT_NEAR(o.normal_stress * s.area() / weight, 1, 1e-4);

  const std::vector<ContactForce> contacts = contact_forces(s, now);
  double n = 0, z1 = 0, z2 = 0, f1 = 0, zf = 0;
  std::vector<std::pair<double, double>> profile;
  const double low = 0.3 * top, high = 0.85 * top;
  for (double z = low; z < high; z += 0.005 * top) {
    double above = 0;
    for (Index i = 0; i < now.size(); ++i)
      if (now.x[i].z > z) above += mass(s, now.r[i]) * s.gravity;
    const double f = carried(now, contacts, z);
    EXPECT_NEAR(f, above, 1e-4 * weight) << "z = " << z;
    profile.push_back({z, f});
    n += 1, z1 += z, z2 += z * z, f1 += f, zf += z * f;
  }
  // Linear: no further off the straight line than half a layer of grains, for single grains make it jump; the
  // slope is (1 - porosity) rho g of that part, by the grains whose centres are in it (5 %: half a layer of
  // ten).
  const double slope = (n * zf - z1 * f1) / (n * z2 - z1 * z1), base = (f1 - slope * z1) / n;
  const double layer = 25 * mass(s, 0.01) * s.gravity;
  for (const auto& [z, f] : profile) EXPECT_NEAR(f, base + slope * z, 0.5 * layer);
  double solid = 0;  // m3
  for (Index i = 0; i < now.size(); ++i)
    if (now.x[i].z > low && now.x[i].z < high) solid += sphere_volume(now.r[i]);
  const double porosity = 1 - solid / (s.area() * (high - low));
  EXPECT_NEAR(-slope / ((1 - porosity) * s.density_of(Material::grain) * s.gravity * s.area()), 1, 0.05);
}

ON_EVERY_BACKEND(SettledBed);

}  // namespace
}  // namespace moraine::dem
