// Small cases that between them use every part of the law, of walls, layers, sides and water; a fraction of a
// second each.
#pragma once
#include <string>
#include <vector>

namespace moraine {

// What a scene is computed again with. Threads that share a core take long, so only some scenes have them.
enum Again : unsigned {
  margins = 1,    // neighbour lists of other reach
  reference = 2,  // the GPU's loop on the host
  pieces = 4,     // interrupted and resumed
  threads = 8,    // two and three of them
};

struct ReferenceScene {
  const char* name;
  const char* start;  // a case under the source, or "bed": consolidated small-bed, "imported": 10,000 grains
  std::vector<std::string> keys;  // "KEY=VALUE"; what has a start has the one stage "s"
  unsigned again = 0;

  bool starts() const { return start == std::string("bed") || start == std::string("imported"); }
  bool wet() const { return std::string(name).starts_with("wet"); }
};

inline const char* const small_bed = "tests/run/small-bed";

// One list, of which a later key takes the place of an earlier one of the same name.
inline std::vector<std::string> joined(std::vector<std::string> keys, const std::vector<std::string>& more) {
  for (const std::string& key : more) {
    std::erase_if(keys,
                  [name = key.substr(0, key.find('=') + 1)](const auto& k) { return k.starts_with(name); });
    keys.push_back(key);
  }
  return keys;
}
// The bed under 2 kPa, its top layer driven at 1/s, or by stress, with other keys besides.
inline std::vector<std::string> sheared(const std::vector<std::string>& more = {}) {
  return joined(
      {"stage.s.kind=shear", "stage.s.normal_stress=2000", "stage.s.strain_rate=1", "stage.s.duration=0.15"},
      more);
}
inline std::vector<std::string> by_stress(const std::vector<std::string>& more = {}) {
  return joined({"stage.s.kind=shear_stress", "stage.s.normal_stress=2000", "stage.s.shear_stress=900",
                 "stage.s.duration=0.15"},
                more);
}
inline std::vector<std::string> pressed(const std::vector<std::string>& more = {}) {
  return joined({"stage.s.kind=consolidate", "stage.s.normal_stress=3000", "stage.s.duration=0.15",
                 "stage.s.wall_gamma_n=40", "stage.s.wall_gamma_t=40"},
                more);
}
inline std::vector<std::string> in_water(const std::vector<std::string>& keys) {
  return joined({"fluid.enabled=true", "fluid.compressibility=1e-6", "fluid.permeability_factor=1e-9"}, keys);
}

// The small bed's stages with sizes of some 1:18 at random places.
inline std::vector<std::string> graded(const std::vector<std::string>& more = {}) {
  return joined({"grains.distribution=fractal", "grains.fractal_dimension=1.2", "grains.radius_min=0.003",
                 "grains.radius_max=0.06", "grains.placement=random", "box.x=0.3", "box.y=0.3",
                 "stage.settle.duration=0.08", "stage.settle.gamma_n=2", "stage.settle.wall_gamma_n=5",
                 "stage.settle.wall_gamma_t=5", "stage.consolidate.duration=0.03",
                 "stage.consolidate.wall_gamma_n=5", "stage.consolidate.wall_gamma_t=5",
                 "stage.shear.strain=0.015", "stage.shear.bottom_layer=0.04", "stage.shear.top_layer=0.06"},
                more);
}

inline const std::vector<ReferenceScene>& reference_scenes() {
  static const std::vector<ReferenceScene> list{
      {"small_bed", small_bed, {}, margins | pieces},
      {"quick_shear",
       "cases/quick-shear",
       {"count=200", "box.x=0.215", "box.y=0.215", "columns_x=5", "columns_y=5", "stage.settle.f=0.05",
        "stage.settle.duration=0.12", "stage.consolidate.f=0.04", "stage.consolidate.duration=0.01",
        "stage.shear.strain=0.001", "series_interval=0.002"}},
      {"wide",
       small_bed,
       {"grains.distribution=uniform", "grains.radius_min=0.012", "grains.radius_max=0.028",
        "stage.settle.duration=0.3", "stage.shear.strain=0.05"},
       margins | reference},
      {"graded", small_bed, graded(), margins | reference | pieces | threads},
      {"imported",
       "imported",
       {"stage.s.kind=shear", "stage.s.normal_stress=1e4", "stage.s.strain_rate=0.05",
        "stage.s.zero_kinematics=false", "stage.s.duration=4e-4", "model.dt=2e-6",
        "output.series_interval=1e-4"},
       threads},
      {"sheared", "bed", sheared(), pieces},
      {"backwards", "bed", sheared({"stage.s.strain_rate=0", "stage.s.velocity=-0.3"})},
      {"softening", "bed", sheared({"stage.s.mu_s=0.6", "stage.s.mu_d=0.3", "stage.s.duration=0.06"}),
       margins | reference | threads},
      {"no_friction", "bed", sheared({"stage.s.mu_s=0", "stage.s.mu_d=0"}), reference},
      {"no_tangential_spring", "bed", sheared({"contact.k_t=0", "stage.s.gamma_t=3"})},
      {"damped", "bed", sheared({"stage.s.gamma_n=5", "stage.s.gamma_t=3"}), margins | reference | pieces},
      {"damped_softening", "bed",
       sheared({"stage.s.gamma_n=5", "stage.s.gamma_t=3", "stage.s.mu_s=0.6", "stage.s.mu_d=0.3"})},
      {"damped_walls", "bed",
       sheared({"stage.s.wall_gamma_n=20", "stage.s.wall_mu=0.3", "stage.s.wall_gamma_t=10"}), reference},
      {"wall_springs", "bed", pressed({"wall.k_t=2e5", "stage.s.wall_mu=0.2"})},
      {"no_ledger", "bed", sheared({"model.ledger=false"})},
      {"no_ledger_damped", "bed", sheared({"model.ledger=false", "stage.s.gamma_n=5", "stage.s.gamma_t=3"})},
      {"by_stress", "bed", by_stress(), reference},
      {"by_stress_damped", "bed",
       by_stress({"stage.s.gamma_n=5", "stage.s.gamma_t=3", "stage.s.duration=0.06"}), threads | pieces},
      {"uniaxial", "bed", {"stage.s.kind=uniaxial", "stage.s.strain_rate=0.3", "stage.s.duration=0.15"}},
      {"tide", "bed",
       sheared({"stage.s.normal_stress_amplitude=500", "stage.s.normal_stress_frequency=40",
                "stage.s.normal_stress_phase=1", "stage.s.duration=0.06"}),
       threads},
      {"hertz", "bed", sheared({"contact.law=hertz", "contact.young=7e8", "stage.s.duration=0.06"}),
       margins | reference | pieces},
      {"hertz_restitution_rolling", "bed",
       sheared({"contact.law=hertz", "contact.young=7e8", "contact.restitution=0.7", "contact.mu_roll=0.2",
                "contact.k_roll=5e4", "stage.s.duration=0.06"}),
       reference | pieces | threads},
      {"rolling", "bed", sheared({"contact.mu_roll=0.2", "stage.s.duration=0.06"}),
       margins | reference | pieces},
      {"twisting_cohesion", "bed",
       sheared({"contact.mu_roll=0.2", "contact.mu_twist=0.1", "contact.cohesion=0.1", "wall.cohesion=0.1",
                "stage.s.duration=0.06"}),
       reference | pieces | threads},
      {"loads_that_change", "bed",
       sheared({"stage.s.strain_rate=0", "stage.s.duration=0.06",
                "stage.s.velocity={ times = [0, 0.02, 0.1], values = [0.1, 0.3, 0.1] }",
                "stage.s.normal_stress={ ramp = [2000, 3000], over = 0.05 }", "stage.s.profile=cosine"}),
       margins | reference | pieces},
      {"held_layers", "bed",
       sheared({"stage.s.hold_layer_height=true", "stage.s.top_wall=fixed", "stage.s.normal_stress=0"})},
      {"no_walls", "bed",
       sheared({"stage.s.hold_layer_height=true", "stage.s.top_wall=none", "stage.s.normal_stress=0",
                "box.floor=false"})},
      {"automatic_dt", "bed", sheared({"model.dt=auto"}), margins | pieces},
      {"periodic_z",
       "bed",
       {"stage.s.kind=settle", "stage.s.duration=0.03", "stage.s.zero_kinematics=false", "box.periodic=xyz",
        "box.floor=false", "box.z=0.257", "guards.max_overlap=0.5"},
       margins | reference | threads},
      {"open_sides",
       "bed",
       {"stage.s.kind=settle", "stage.s.duration=0.1", "box.periodic=none", "stage.s.wall_gamma_n=40",
        "stage.s.wall_gamma_t=40"}},
      {"open_sides_y", "bed", sheared({"box.periodic=x"}), reference},
      {"wet_drained", "bed", in_water(pressed()), reference | pieces},
      {"wet_impermeable", "bed", in_water(sheared({"stage.s.fluid_top=impermeable"})), margins | reference},
      {"wet_several_steps", "bed",
       in_water(sheared({"stage.s.f=0.05", "stage.s.duration=0.05", "fluid.exchange_interval=7"})),
       margins | reference | pieces | threads},
      {"wet_longest_interval", "bed", in_water(sheared({"stage.s.f=0.02", "stage.s.duration=0.03"})),
       reference},
      {"wet_damped", "bed", in_water(sheared({"stage.s.gamma_n=5", "stage.s.gamma_t=3"})), reference},
      {"wet_damped_several_steps", "bed",
       in_water(sheared({"stage.s.gamma_n=5", "stage.s.gamma_t=3", "stage.s.f=0.05", "stage.s.duration=0.05",
                         "fluid.exchange_interval=7"})),
       threads | pieces},
      {"wet_by_stress", "bed", in_water(by_stress())},
      {"wet_softening", "bed", in_water(sheared({"stage.s.mu_s=0.6", "stage.s.mu_d=0.3"}))},
      {"wet_open_sides", "bed",
       in_water({"stage.s.kind=settle", "stage.s.duration=0.15", "stage.s.f=0.05", "box.periodic=y",
                 "fluid.x_low=pressure", "fluid.x_high=pressure", "stage.s.wall_gamma_n=40",
                 "stage.s.wall_gamma_t=40"})},
      {"wet_tide", "bed",
       in_water(pressed({"stage.s.top_pressure=100", "stage.s.top_pressure_amplitude=300",
                         "stage.s.top_pressure_frequency=5"}))},
      {"wet_gradient_only", "bed", in_water(sheared({"fluid.closure=pressure_gradient"}))},
      {"wet_no_ledger", "bed", in_water(sheared({"model.ledger=false"}))},
      {"wet_cholmod", "bed", in_water(sheared({"fluid.solver=cholmod"}))},
      {"wet_graded", small_bed,
       graded({"fluid.compressibility=1e-6", "stage.consolidate.fluid=true", "stage.shear.fluid=true",
               "fluid.cells_x=3", "fluid.cells_y=3", "fluid.cells_z=3"}),
       margins | reference | pieces},
      {"wet_after_dry",
       small_bed,
       {"fluid.compressibility=1e-6", "fluid.permeability_factor=1e-8", "stage.consolidate.fluid=true",
        "stage.shear.fluid=true", "stage.shear.fluid_top=impermeable", "stage.settle.duration=0.4",
        "stage.shear.strain=0.05"},
       pieces},
  };
  return list;
}

}  // namespace moraine
