// A case: a directory with case.toml in it, read, merged with what it extends and with --set, and checked.
// Everything here is SI; units exist only in this folder.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "dem/scene.hpp"
#include "dem/state.hpp"
#include "history.hpp"

namespace moraine::cases {

// Of a material, for Hertz and Mindlin's law.
struct Elastic {
  double young;    // Pa
  double poisson;  // 1
  bool operator==(const Elastic&) const = default;
};

struct Grains {
  std::int64_t count;
  std::string distribution;                  // "lognormal", "uniform", "fractal", "sieves", "bimodal"
  double radius_mean;                        // m
  double radius_std;                         // m, lognormal; bimodal: of the coarse
  double fine_radius_mean, fine_radius_std;  // m, bimodal
  double fine_fraction;                      // bimodal: of the mass
  double radius_min, radius_max;             // m, uniform, fractal; limits of lognormal and bimodal, 0: none
  double fractal_dimension;                  // fractal
  std::filesystem::path sieves;              // a table of sizes and what is finer
  std::string placement;                     // "lattice", "random"
  double solid_fraction;                     // random
  double density;                            // kg/m3
  std::string material;                      // of those that no material takes; empty: of the only one
  std::uint64_t seed;
  std::int64_t columns_x, columns_y;  // of the starting lattice
  double cell;                        // side of a lattice cell in largest grain diameters
  bool operator==(const Grains&) const = default;
};

// A material of grains or walls.
struct GrainMaterial {
  std::string name;
  std::map<std::string, double> of;  // its keys by name ("mu_s", "density"), SI; those not given by contact.*
  std::vector<double> sizes, layer;  // m, from, to: diameters and heights of the grains it takes; empty: none
  bool operator==(const GrainMaterial&) const = default;
};
// What [[pair]] says of two materials, in whatever order; "wall" stands for walls.
struct MaterialPair {
  std::string first, second;
  std::map<std::string, double> given;
  bool operator==(const MaterialPair&) const = default;
};
enum class PairRule { geometric, minimum, table };

// What water does at a side of the box.
struct FluidSide {
  enum class Kind { no_flow, pressure, flux };
  Kind kind;
  double pressure;  // Pa
  double flux;      // m/s, into the bed
  bool operator==(const FluidSide&) const = default;
};

// Pore water (src/coupling).
struct Fluid {
  enum class Closure { full, pressure_gradient };
  enum class Solver { automatic, pcg, cholmod };
  bool enabled;
  double viscosity;                        // Pa s
  double compressibility;                  // 1/Pa
  double density;                          // kg/m3
  double permeability_factor;              // m2, k_c; 0: d^2/180, local Sauter mean
  double porosity_min, porosity_max;       // 1, kept within for permeability and storage
  double cell;                             // mean diameters
  std::int64_t cells_x, cells_y, cells_z;  // 0: by `cell`
  double height;                           // m, of the grid where there is no top wall; 0: the bed and a cell
  Closure closure;
  std::int64_t exchange_interval;  // steps; 0: the longest that is stable
  Solver solver;
  double tolerance;
  FluidSide x_low, x_high, y_low, y_high;  // where not periodic
  bool operator==(const Fluid&) const = default;
};

struct Stage {
  std::set<std::string> own;  // with materials: keys of contacts that it gives itself, "mu_s"
  enum class FluidTop { drained, impermeable };
  enum class FluidBottom { no_flow, pressure, flux };
  enum class Kind { settle, consolidate, shear, shear_stress, uniaxial, press };
  enum class TopWall { automatic, stress, fixed, none };
  std::string name;
  Kind kind;
  double duration;   // s; 0 where `strain` is given
  double strain;     // shear strain u t/H_0, or axial strain for uniaxial; 0 where `duration` is given
  TopWall top_wall;  // automatic: none for settle and press, prescribed for uniaxial, else stress
  // Loads. Where one follows a history, which is empty else, the number is the largest value.
  double normal_stress;  // Pa
  History normal_stress_history;
  double normal_stress_amplitude, normal_stress_frequency, normal_stress_phase;  // Pa, Hz, rad
  double velocity;  // m/s, of the top layer; 0 where strain_rate is given
  History velocity_history;
  double velocity_amplitude, velocity_frequency, velocity_phase;  // m/s, Hz, rad
  dem::Profile profile;                                           // of the velocity across y
  double strain_rate;  // 1/s; times the bed height gives the velocity (shear), axial (uniaxial), of each side
                       // (press)
  double shear_stress;  // Pa, for shear_stress
  History shear_stress_history;
  double shear_stress_amplitude, shear_stress_frequency, shear_stress_phase;  // Pa, Hz, rad
  double porosity;    // 1, that a press or a uniaxial stage ends with; 0 where something else ends it
  double pressure;    // Pa, of a press, on all sides of the box; 0 where porosity is given
  double layer_mass;  // kg, that the shear stress moves besides the grains of the layer
  double bottom_layer, top_layer;  // m, thickness by grain centres; negative: one largest diameter
  bool hold_layer_height;
  double f;                           // eq. 9
  double gamma_n, gamma_t;            // N s/m, between grains
  double mu_s, mu_d;                  // between grains, in this stage
  double wall_gamma_n, wall_gamma_t;  // N s/m
  double restitution, wall_restitution;
  double wall_mu;
  bool zero_kinematics;  // velocities, spins and rotations set to zero when the stage begins
  bool clear_history;    // tangential springs forgotten when the stage begins
  bool fluid;            // pore water in this stage
  FluidTop fluid_top;
  double top_pressure;  // Pa
  History top_pressure_history;
  double top_pressure_amplitude, top_pressure_frequency, top_pressure_phase;  // Pa, Hz, rad
  FluidBottom fluid_bottom;
  double bottom_pressure;  // Pa
  History bottom_pressure_history;
  double bottom_pressure_amplitude, bottom_pressure_frequency, bottom_pressure_phase;  // Pa, Hz, rad
  double bottom_flux;  // m/s, upwards into the bed

  bool has_histories() const {
    return normal_stress_history.is_there() || velocity_history.is_there() ||
           shear_stress_history.is_there() || top_pressure_history.is_there() ||
           bottom_pressure_history.is_there();
  }
  bool operator==(const Stage&) const = default;
};

struct Output {
  double series_interval;      // s of model time
  double snapshot_interval;    // s of model time
  double checkpoint_interval;  // s of wall clock
  bool operator==(const Output&) const = default;
};

// Where a run that goes wrong is stopped (src/run/guard.hpp).
struct Guards {
  std::int64_t interval;  // steps
  double max_overlap;     // of the smaller radius
  double max_residue;     // of the energy stored and put in
  bool operator==(const Guards&) const = default;
};

struct Case {
  std::filesystem::path directory;
  std::string title;
  std::filesystem::path start;  // empty, or an HDF5 checkpoint (a case directory given as start is resolved
                                // to its output/checkpoint.h5)
  double box_x, box_y, box_z;   // m; 0: from the lattice (x, y)
  bool periodic_x, periodic_y, periodic_z;
  bool floor;
  bool walls_x, walls_y;  // at both sides
  Grains grains;
  std::string preset;  // "none", or what filled f, softening and wall viscosity
  double softening;    // what the stiffnesses below have been divided by
  enum class Law { linear, hertz };
  Law law;
  Elastic elastic, wall_elastic;
  double restitution, wall_restitution;
  // What contact.* and wall.* say, the law's stiffness included (k_n of walls is that of contacts); stages
  // have their own damping and friction.
  dem::ContactParameters contact, wall;
  std::vector<GrainMaterial> materials;  // of grains; empty: one that has no name
  std::vector<GrainMaterial> of_walls;   // one, where wall.material names it
  std::vector<MaterialPair> pairs;
  PairRule pair_rule;
  std::string wall_material;
  double wall_mass;         // kg; 0: 0.001 of the mass of N spheres as wide as a lattice cell
  double gravity;           // m/s2
  double slope;             // rad, of the ground, down towards +x
  double density_scaling;   // m, smaller radii have the inertia of this one; 0: none
  double dt;                // s; 0: by eq. 9
  bool automatic_dt;        // dt follows the contact network instead
  double safety;            // of the critical step, with automatic_dt
  double neighbour_margin;  // m; 0: automatic
  bool ledger;
  Fluid fluid;
  std::vector<Stage> stages;
  Output output;
  Guards guards;

  bool has_water() const;      // in any stage
  bool presses() const;        // in any stage
  bool has_histories() const;  // in any stage
  // Tables that loads come from, in the order of stages and keys.
  std::vector<std::filesystem::path> tables;
  std::string resolved;  // the merged case.toml, SI numbers, ready to be written and read again
  bool operator==(const Case&) const = default;
};

struct Override {
  std::string key;    // "model.f", "stage.shear.normal_stress", "normal_stress" (of each stage that gives it)
  std::string value;  // TOML, or a bare unit string: 80 kPa
};

// Throws Error naming file, line, key, value, what was expected and the nearest known key.
Case load(const std::filesystem::path& directory, const std::vector<Override>& overrides = {});

// What this text would be as the case.toml of that directory, with what it extends, its preset and all
// defaults, in SI. Each value is checked by itself, but not what depends on several: the case may be
// unfinished.
std::string filled(const std::filesystem::path& directory, const std::string& text);

// A case as it was resolved (Case::resolved), of this directory.
Case load_resolved(const std::filesystem::path& directory, const std::string& text);

// A case.toml for another directory that is this case with these overrides; `base` leads from there back
// here.
std::string extension_text(const std::filesystem::path& directory, const std::vector<Override>& overrides,
                           const std::string& base);

// What differs between two resolved cases.
struct Change {
  std::string key, before, now;  // "stage.shear.normal_stress", "2000.0 Pa", "3000.0 Pa"
  bool physics;                  // so that a run cannot go on with it
};
std::vector<Change> changes(const std::string& resolved_before, const Case& now);

// The reference of all keys (name, unit, default, meaning), as `moraine keys` prints it; or of those that
// have each of these words in their name or meaning. Throws Error where there are none.
std::string reference(const std::vector<std::string>& words = {});

}  // namespace moraine::cases
