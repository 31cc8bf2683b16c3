#include "case/keys.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdio>
#include <type_traits>
#include <utility>

#include "case/preset.hpp"
#include "error.hpp"

namespace moraine::cases {
namespace {

using std::string;
using Type = Key::Type;

// Follows pointers to members from Case or Stage down to the field.
template <auto first, auto... rest>
auto& field(Case& c, Stage& s) {
  if constexpr (std::is_invocable_v<decltype(first), Case&>)
    return ((c.*first).*....*rest);
  else
    return ((s.*first).*....*rest);
}

template <auto... members>
void set(const Key& key, Case& c, Stage& s, const Value& value) {
  auto& target = field<members...>(c, s);
  using T = std::remove_reference_t<decltype(target)>;
  if constexpr (std::is_enum_v<T>) {  // choices stand in the order of the enumerators
    const auto choices = split(key.accepts, " | ");
    target = T(std::find(choices.begin(), choices.end(), std::get<string>(value)) - choices.begin());
  } else if constexpr (std::is_same_v<T, bool> || std::is_same_v<T, double>) {
    target = std::get<T>(value);
  } else if constexpr (std::is_integral_v<T>) {
    target = T(std::get<std::int64_t>(value));
  } else {
    target = std::get<string>(value);
  }
}

void set_periodic(const Key&, Case& c, Stage&, const Value& value) {
  const auto& axes = std::get<string>(value);
  const auto has = [&](char axis) { return axes != "none" && axes.find(axis) != axes.npos; };
  c.periodic_x = has('x'), c.periodic_y = has('y'), c.periodic_z = has('z');
}

void set_walls(const Key&, Case& c, Stage&, const Value& value) {
  const auto& axes = std::get<string>(value);
  c.walls_x = axes.find('x') != axes.npos, c.walls_y = axes.find('y') != axes.npos;
}

void set_dt(const Key&, Case& c, Stage&, const Value& value) {
  c.automatic_dt = std::holds_alternative<string>(value);
  c.dt = c.automatic_dt ? 0 : std::get<double>(value);
}

void set_nothing(const Key&, Case&, Stage&, const Value&) {}  // only a default for the stages

template <class T>
Type type_of(const string& accepts) {
  if (std::is_same_v<T, double>) return Type::number;
  if (std::is_same_v<T, bool>) return Type::boolean;
  if (std::is_integral_v<T>) return Type::integer;
  if (std::is_same_v<T, std::filesystem::path>) return Type::path;
  return accepts.empty() ? Type::text : Type::choice;
}

template <auto... members>
Key row(string name, string unit, string fallback, string accepts, string meaning, string kinds = "") {
  using T =
      std::remove_reference_t<decltype(field<members...>(std::declval<Case&>(), std::declval<Stage&>()))>;
  return {name, type_of<T>(accepts), unit, fallback, accepts, meaning, kinds, set<members...>};
}

// A number, or a history; of that the member for the number has the largest value.
template <auto number, auto history>
void set_load(const Key&, Case&, Stage& s, const Value& value) {
  const Load* load = std::get_if<Load>(&value);
  s.*history = load ? load->history : History{};
  s.*number = load ? load->history.largest() : std::get<double>(value);
}
template <auto number, auto history>
Key load_row(string name, string unit, string accepts, string meaning, string kinds = "") {
  return {name,    Type::load,
          unit,    "0",
          accepts, meaning + "; or a history, see below",
          kinds,   set_load<number, history>};
}

// The rows of the sinusoid that is added to a load.
template <auto amplitude, auto frequency, auto phase>
std::vector<Key> sinusoid_rows(const string& load, const string& unit, const string& kinds = "") {
  const string key = "stage." + load;
  return {
      // clang-format off
      row<amplitude>(key + "_amplitude", unit, "0", "", "of a sinusoid added to " + load, kinds),
      row<frequency>(key + "_frequency", "Hz", "0", ">= 0", "of that sinusoid", kinds),
      row<phase>(key + "_phase", "rad", "0", "", "of that sinusoid when the stage begins; a stage that asks for the same as the one before goes on with it", kinds),
      // clang-format on
  };
}

Key no_physics(Key key) {
  key.decides = Key::Decides::nothing;
  return key;
}
Key records(Key key) {
  key.decides = Key::Decides::records;
  return key;
}

// The rows of one vertical side of the water's grid.
template <auto side>
std::vector<Key> side_rows(const string& name, const string& place) {
  const string key = "fluid." + name, axis = name.substr(0, 1);
  constexpr auto fluid = &Case::fluid;
  return {
      // clang-format off
      row<fluid, side, &FluidSide::kind>(key, "", "\"no_flow\"", "no_flow | pressure | flux", "the side " + place + ", where " + axis + " is not periodic: tight, at " + name + "_pressure, or with " + name + "_flux through it"),
      row<fluid, side, &FluidSide::pressure>(key + "_pressure", "Pa", "0", "", "over hydrostatic, at that side"),
      row<fluid, side, &FluidSide::flux>(key + "_flux", "m/s", "0", "", "Darcy velocity through that side, into the bed"),
      // clang-format on
  };
}

// What a [[material]] may have of its own, and a [[pair]] of two: the rows of `contact` again. A further one
// that differs from material to material has its name here.
const std::vector<string> of_materials = {"k_n",     "k_t",      "young",   "poisson",     "gamma_n",
                                          "gamma_t", "mu_s",     "mu_d",    "restitution", "mu_roll",
                                          "k_roll",  "mu_twist", "k_twist", "cohesion"};
bool of_one_alone(const string& name) { return name == "young" || name == "poisson"; }
std::vector<Key> rows_of_materials(const std::vector<Key>& table) {
  // clang-format off
  std::vector<Key> rows{
      {"material.name", Type::text, "", required, "", "unique; letters, digits, - and _", "", set_nothing},
      {"material.density", Type::number, "kg/m3", "grains.density", "> 0", "of these grains", "", set_nothing},
      {"material.sizes", Type::list, "", "[]", "", "grains with diameters from the first of two lengths to below the second are of this material: [\"1 mm\", \"2 cm\"]", "", set_nothing},
      {"material.layer", Type::list, "", "[]", "", "grains whose centres begin at heights from the first of two lengths to below the second are of this material: [\"0 m\", \"0.1 m\"]", "", set_nothing}};
  // clang-format on
  const auto append_for = [&](const string& owner, const string& fallback, const string& meaning) {
    for (const string& name : of_materials) {
      if (owner == "pair." && of_one_alone(name)) continue;
      Key key = *std::find_if(table.begin(), table.end(),
                              [&](const Key& k) { return k.name == "contact." + name; });
      key.name = owner + name, key.set = set_nothing,
      key.fallback = fallback.empty() ? "contact." + name : fallback;
      key.meaning = split(key.meaning, "; a stage")[0].substr(0, key.meaning.find(", at most")) + meaning;
      rows.push_back(key);
    }
  };
  append_for("material.", "", " of its grains among each other, where a stage has none of its own");
  rows.push_back(
      {"pair.of", Type::list, "", required, "", "two materials, or one and \"wall\"", "", set_nothing});
  append_for("pair.", "contact.pairs", " between the two, where a stage has none of its own");
  return rows;
}

void append(std::vector<Key>& table, const std::vector<Key>& rows) {
  table.insert(table.end(), rows.begin(), rows.end());
}

std::vector<Key> make_keys() {
  using C = Case;
  using G = Grains;
  using S = Stage;
  using O = Output;
  constexpr auto grains = &C::grains;
  constexpr auto output = &C::output;
  constexpr auto guards = &C::guards;
  using F = Fluid;
  constexpr auto fluid = &C::fluid;
  using P = dem::ContactParameters;
  using E = Elastic;
  constexpr auto contact = &C::contact;
  constexpr auto wall = &C::wall;
  const string sheared = "shear, shear_stress", damped = "; settle, consolidate: ";
  std::vector<Key> table{
      // clang-format off
      no_physics(row<&C::title>("title", "", "\"\"", "", "what the case is about")),
      {"extends", Type::text, "", "\"\"", "", "directory of a case whose keys and stages this one takes over", "", nullptr},
      row<&C::start>("start", "", "\"\"", "", "where the grains come from: a finished case, a checkpoint file, a table of grains NAME.csv with the columns x, y, z, r (and vx .. vz, wx .. wz, role), a LAMMPS data file NAME.data, or a snapshot; empty: drawn, see grains"),
      {"stages", Type::list, "", "[]", "", "names of the stages to run, in order; empty: all", "", nullptr},

      row<&C::box_x>("box.x", "m", "0", ">= 0", "side along the shear direction; 0: from the lattice or `start`, or by grains.solid_fraction where z is periodic"),
      row<&C::box_y>("box.y", "m", "0", ">= 0", "side across; 0: from the lattice or `start`, or by grains.solid_fraction where z is periodic"),
      row<&C::box_z>("box.z", "m", "0", ">= 0", "height; counts only where z is periodic; 0: from `start`, or by grains.solid_fraction"),
      {"box.periodic", Type::choice, "", "\"xy\"", "none | x | y | z | xy | xz | yz | xyz", "periodic sides", "", set_periodic},
      row<&C::floor>("box.floor", "", "true", "", "fixed wall at z = 0"),
      {"box.walls", Type::choice, "", "\"none\"", "none | x | y | xy", "fixed walls at both sides of an axis that is not periodic; as rough as the floor (wall.k_t, stage.wall_mu)", "", set_walls},

      row<grains, &G::count>("grains.count", "", "10000", "1 .. 2147483647", "number of grains"),
      row<grains, &G::distribution>("grains.distribution", "", "\"lognormal\"", "lognormal | uniform | fractal | sieves | bimodal", "of the radii"),
      row<grains, &G::radius_mean>("grains.radius_mean", "m", "0.02", "> 0", "lognormal: mean radius; bimodal: of the coarse grains"),
      row<grains, &G::radius_std>("grains.radius_std", "m", "9.38e-5", ">= 0", "lognormal: standard deviation of the radius; bimodal: of the coarse grains"),
      row<grains, &G::fine_radius_mean>("grains.fine_radius_mean", "m", "0", ">= 0", "bimodal: mean radius of the fine grains, which are log-normal, too"),
      row<grains, &G::fine_radius_std>("grains.fine_radius_std", "m", "0", ">= 0", "bimodal: their standard deviation"),
      row<grains, &G::fine_fraction>("grains.fine_fraction", "1", "0", "0 .. 1", "bimodal: their share of the mass"),
      row<grains, &G::radius_min>("grains.radius_min", "m", "0", ">= 0", "uniform, fractal: least radius; lognormal: smaller ones are drawn again; bimodal: there are no smaller ones"),
      row<grains, &G::radius_max>("grains.radius_max", "m", "0", ">= 0", "uniform, fractal: largest radius; lognormal: larger ones are drawn again, bimodal: there are none, 0: no limit"),
      row<grains, &G::fractal_dimension>("grains.fractal_dimension", "1", "2.6", "> 0", "fractal: as many grains are larger than r as r^-D; 3: the same mass at each size"),
      row<grains, &G::sieves>("grains.sieves", "", "\"\"", "", "sieves: a CSV file with the columns size (m) and finer (1, by mass), or other units: size (mm), finer (%)"),
      row<grains, &G::density>("grains.density", "kg/m3", "2600", "> 0", "of the grains"),
      row<grains, &G::material>("grains.material", "", "\"\"", "", "of all grains that no [[material]] takes by size or layer; empty: there is one material only, or a table of grains says it"),
      row<grains, &G::seed>("grains.seed", "", "1", ">= 0", "of the random radii and places"),
      row<grains, &G::placement>("grains.placement", "", "\"lattice\"", "lattice | random", "where grains begin: one in each cell of a lattice; or anywhere in box.x and box.y (and box.z where z is periodic), largest first"),
      row<grains, &G::solid_fraction>("grains.solid_fraction", "1", "0.25", "0.001 .. 0.35", "random: share of the space that the grains fill at first"),
      row<grains, &G::columns_x>("grains.columns_x", "", "10", ">= 1", "lattice cells along x"),
      row<grains, &G::columns_y>("grains.columns_y", "", "10", ">= 1", "lattice cells along y"),
      row<grains, &G::cell>("grains.cell", "1", "2.1", ">= 1.05", "side of a lattice cell in largest grain diameters"),

      row<&C::law>("contact.law", "", "\"linear\"", "linear | hertz", "linear springs k_n and k_t; or Hertz and Mindlin, of elastic spheres with young and poisson (k_n and k_t then do not count)"),
      row<contact, &P::k_n>("contact.k_n", "N/m", "1.16e9", "> 0", "normal stiffness of linear springs"),
      row<contact, &P::k_t>("contact.k_t", "N/m", "1.16e9", ">= 0", "tangential stiffness of linear springs"),
      row<&C::elastic, &E::young>("contact.young", "Pa", "0", ">= 0", "hertz: Young's modulus"),
      row<&C::elastic, &E::poisson>("contact.poisson", "1", "0.25", "0 .. 0.5", "hertz: Poisson's ratio"),
      row<&C::restitution>("contact.restitution", "1", "1", "0.05 .. 1", "coefficient of restitution of two free grains, by damping of the normal direction beside gamma_n; 1: none; a stage may have its own"),
      row<contact, &P::gamma_n>("contact.gamma_n", "N s/m", "0", ">= 0", "normal viscosity; a stage may have its own"),
      row<contact, &P::gamma_t>("contact.gamma_t", "N s/m", "0", ">= 0", "tangential viscosity; a stage may have its own"),
      row<contact, &P::mu_s>("contact.mu_s", "1", "0.3", ">= 0", "static friction; a stage may have its own"),
      row<contact, &P::mu_d>("contact.mu_d", "1", "contact.mu_s", ">= 0", "dynamic friction, at most mu_s; a stage may have its own"),
      row<contact, &P::mu_roll>("contact.mu_roll", "1", "0", ">= 0", "resistance to rolling, of grains that are not round: the couple is at most mu_roll R f_n, 1/R = 1/r_i + 1/r_j; 0: none"),
      row<contact, &P::k_roll>("contact.k_roll", "N/m", "contact.k_t", ">= 0", "stiffness against rolling before that, as a force at R"),
      row<contact, &P::mu_twist>("contact.mu_twist", "1", "0", ">= 0", "resistance to twisting about the normal: the couple is at most mu_twist R f_n; 0: none"),
      row<contact, &P::k_twist>("contact.k_twist", "N/m", "contact.k_roll", ">= 0", "stiffness against twisting before that, as a force at R"),
      row<contact, &P::cohesion>("contact.cohesion", "N", "0", ">= 0", "constant pull of grains that touch, which friction does not see"),
      row<&C::pair_rule>("contact.pairs", "", "\"geometric\"", "geometric | minimum | table", "of grains of unlike materials: the geometric mean of friction, rolling, restitution and viscosity, the smaller one, or what [[pair]] says, which is then needed for all; what a [[pair]] leaves out is geometric; stiffnesses are those of two springs in series, 2 k_1 k_2/(k_1 + k_2), or Hertz's for young and poisson"),

      row<wall, &P::k_t>("wall.k_t", "N/m", "0", ">= 0", "tangential stiffness against walls; k_n is that of contacts"),
      row<&C::wall_material>("wall.material", "", "\"\"", "", "a [[material]] that floor and walls are of, so that contact.pairs says what is between them and grains, but for viscosities and for friction, which is stage.wall_mu or that of a [[pair]] with \"wall\"; empty: they have the keys of [wall], and the grain's k_n"),
      row<&C::wall_elastic, &E::young>("wall.young", "Pa", "contact.young", ">= 0", "hertz: Young's modulus of walls; slip at walls takes wall_mu"),
      row<&C::wall_elastic, &E::poisson>("wall.poisson", "1", "contact.poisson", "0 .. 0.5", "hertz: Poisson's ratio of walls"),
      row<&C::wall_restitution>("wall.restitution", "1", "1", "0.05 .. 1", "coefficient of restitution against walls that do not give way, by damping beside their gamma_n; a stage may have its own"),
      row<wall, &P::mu_roll>("wall.mu_roll", "1", "0", ">= 0", "resistance to rolling on walls, R = r"),
      row<wall, &P::k_roll>("wall.k_roll", "N/m", "contact.k_roll", ">= 0", "stiffness against rolling on walls"),
      row<wall, &P::mu_twist>("wall.mu_twist", "1", "0", ">= 0", "resistance to twisting on walls"),
      row<wall, &P::k_twist>("wall.k_twist", "N/m", "wall.k_roll", ">= 0", "stiffness against twisting on walls"),
      row<wall, &P::cohesion>("wall.cohesion", "N", "0", ">= 0", "constant pull of walls on grains that touch them"),
      row<&C::wall_mass>("wall.mass", "kg", "0", ">= 0", "of the top wall; 0: 0.001 of the mass of N spheres as wide as a lattice cell"),
      row<wall, &P::gamma_n>("wall.gamma_n", "N s/m", "1e4", ">= 0", "normal viscosity against walls while settling and consolidating; a stage may have its own"),
      row<wall, &P::gamma_t>("wall.gamma_t", "N s/m", "1e4", ">= 0", "tangential viscosity against walls, likewise"),

      row<&C::gravity>("model.gravity", "m/s2", "9.80665", ">= 0", "along -z; see slope"),
      row<&C::slope>("model.slope", "rad", "0", "-1.57 .. 1.57", "of the ground, falling towards +x: gravity acts along (sin, 0, -cos) of it; x stays along the bed and z at right angles to it"),
      row<&C::density_scaling>("model.density_scaling", "m", "0", ">= 0", "density scaling by size, for a longer step: radii below this have the inertia of this one, and their own weight; 0: none"),
      row<&C::preset>("model.preset", "", "\"none\"", "none | paper | standard | fast", "accuracy against time: sets f, softening and the walls' viscosity where the case does not; see below"),
      row<&C::softening>("model.softening", "1", "1", ">= 1", "stiffnesses of grains and walls (k_n, k_t, young, k_roll, k_twist) are divided by it; viscosities are not"),
      {"model.f", Type::number, "1", "0.075", "> 0", "time step in units of sqrt(min m / max(k_n, k_t)), eq. 9; a stage may have its own", "", set_nothing},
      {"model.dt", Type::number, "s", "0", ">= 0 | auto", "time step; 0: by f; \"auto\": safety times the critical step of the present contact network", "", set_dt},
      row<&C::safety>("model.safety", "1", "0.5", "0.01 .. 1", "dt = \"auto\": share of the critical step"),
      no_physics(row<&C::neighbour_margin>("model.neighbour_margin", "m", "0", ">= 0", "of the neighbour list; 0: automatic; changes no result")),
      row<&C::ledger>("model.ledger", "", "true", "", "account for every joule"),

      row<fluid, &F::enabled>("fluid.enabled", "", "false", "", "pore water in the stages; a stage may say otherwise"),
      row<fluid, &F::viscosity>("fluid.viscosity", "Pa s", "1.8e-3", "> 0", "of the water"),
      row<fluid, &F::compressibility>("fluid.compressibility", "1/Pa", "4.5e-10", "> 0", "of the water"),
      row<fluid, &F::density>("fluid.density", "kg/m3", "1000", "> 0", "of the water, for buoyancy"),
      row<fluid, &F::permeability_factor>("fluid.permeability_factor", "m2", "0", ">= 0", "k_c of k = k_c phi^3/(1 - phi)^2; 0: d^2/180, d the Sauter mean diameter (sum of d^3 over sum of d^2) of the grains in each cell"),
      row<fluid, &F::porosity_min>("fluid.porosity_min", "1", "0.1", "> 0", "storage and permeability take no lower porosity"),
      row<fluid, &F::porosity_max>("fluid.porosity_max", "1", "0.9", "> 0", "nor a higher one"),
      row<fluid, &F::cell>("fluid.cell", "1", "2.5", "> 0", "side of a grid cell in mean diameters, at least; below 2 it measures pores"),
      row<fluid, &F::cells_x>("fluid.cells_x", "", "0", ">= 0", "cells of the grid along x; 0: by fluid.cell"),
      row<fluid, &F::cells_y>("fluid.cells_y", "", "0", ">= 0", "along y"),
      row<fluid, &F::cells_z>("fluid.cells_z", "", "0", ">= 0", "along z, between floor and top wall"),
      row<fluid, &F::height>("fluid.height", "m", "0", ">= 0", "of the grid where there is no top wall; 0: the bed and one cell"),
      row<fluid, &F::closure>("fluid.closure", "", "\"full\"", "full | pressure_gradient", "force on a grain: -V/(1 - phi) grad p, or -V grad p without the drag"),
      row<fluid, &F::exchange_interval>("fluid.exchange_interval", "", "0", ">= 0", "steps between exchanges of grains and water; 0: the longest that is stable"),
      no_physics(row<fluid, &F::solver>("fluid.solver", "", "\"automatic\"", "automatic | pcg | cholmod", "for the pressure")),
      no_physics(row<fluid, &F::tolerance>("fluid.tolerance", "1", "1e-10", "1e-15 .. 1e-6", "of the residual over the right-hand side (pcg)")),
      // clang-format on
  };
  append(table, side_rows<&F::x_low>("x_low", "x = 0"));
  append(table, side_rows<&F::x_high>("x_high", "x = box.x"));
  append(table, side_rows<&F::y_low>("y_low", "y = 0"));
  append(table, side_rows<&F::y_high>("y_high", "y = box.y"));
  append(table, rows_of_materials(table));
  std::vector<Key> of_stages{
      // clang-format off
      row<&S::name>("stage.name", "", required, "", "unique; letters, digits, - and _"),
      row<&S::kind>("stage.kind", "", required, "settle | consolidate | shear | shear_stress | uniaxial | press", "what is done to the bed"),
      row<&S::duration>("stage.duration", "s", "0", ">= 0", "of the stage; this, strain or porosity"),
      row<&S::strain>("stage.strain", "1", "0", ">= 0", "where the stage ends: u t/H_0, or axial; magnitude", "shear, uniaxial"),
      row<&S::top_wall>("stage.top_wall", "", "\"automatic\"", "automatic | stress | fixed | none", "automatic: none to settle or press, driven in uniaxial, else stress"),
      load_row<&S::normal_stress, &S::normal_stress_history>("stage.normal_stress", "Pa", ">= 0", "on the top wall"),
      // clang-format on
  };
  append(of_stages,
         sinusoid_rows<&S::normal_stress_amplitude, &S::normal_stress_frequency, &S::normal_stress_phase>(
             "normal_stress", "Pa"));
  of_stages.push_back(load_row<&S::velocity, &S::velocity_history>(
      "stage.velocity", "m/s", "", "of the top layer; this or strain_rate", "shear"));
  append(of_stages, sinusoid_rows<&S::velocity_amplitude, &S::velocity_frequency, &S::velocity_phase>(
                        "velocity", "m/s", "shear"));
  const std::vector<Key> of_rates{
      // clang-format off
      row<&S::profile>("stage.profile", "", "\"uniform\"", "uniform | linear | cosine | half", "of the velocity across y, times that velocity, by where a grain of the layer stands: 1; y/L; (1 - cos(2 pi y/L))/2; or 1 below L/2 and 0 beyond, L = box.y", "shear"),
      row<&S::strain_rate>("stage.strain_rate", "1/s", "0", "", "velocity over H_0, the height of the bed when shear began; axial; or how fast each side of a pressed box shortens, at most", "shear, uniaxial, press"),
      load_row<&S::shear_stress, &S::shear_stress_history>("stage.shear_stress", "Pa", "", "that drives the top layer", "shear_stress"),
      // clang-format on
  };
  append(of_stages, of_rates);
  append(of_stages,
         sinusoid_rows<&S::shear_stress_amplitude, &S::shear_stress_frequency, &S::shear_stress_phase>(
             "shear_stress", "Pa", "shear_stress"));
  const std::vector<Key> of_layers_and_water{
      // clang-format off
      row<&S::porosity>("stage.porosity", "1", "0", "0 .. 0.99", "that a box is pressed to, all sides alike, in place of pressure; or a bed by its wall, in place of duration and strain", "press, uniaxial"),
      row<&S::pressure>("stage.pressure", "Pa", "0", ">= 0", "of the grains on the sides of the box, on each by itself, for the duration of the stage", "press"),
      row<&S::layer_mass>("stage.layer_mass", "kg", "0", ">= 0", "that the shear stress moves besides the layer's grains, such as that of the ice above", "shear_stress"),
      row<&S::bottom_layer>("stage.bottom_layer", "m", "-1", "", "thickness of the layer that stands still; negative: one largest diameter. A stage that shears on keeps the layers of the one before", sheared),
      row<&S::top_layer>("stage.top_layer", "m", "-1", "", "thickness of the driven layer; negative: one largest diameter", sheared),
      row<&S::hold_layer_height>("stage.hold_layer_height", "", "false", "", "the layers keep their height too", sheared),
      row<&S::f>("stage.f", "1", "model.f", "> 0", "time step, as model.f"),
      row<&S::gamma_n>("stage.gamma_n", "N s/m", "contact.gamma_n", ">= 0", "normal viscosity"),
      row<&S::gamma_t>("stage.gamma_t", "N s/m", "contact.gamma_t", ">= 0", "tangential viscosity"),
      row<&S::mu_s>("stage.mu_s", "1", "contact.mu_s", ">= 0", "static friction"),
      row<&S::mu_d>("stage.mu_d", "1", "contact.mu_d", ">= 0", "dynamic friction, at most mu_s"),
      row<&S::wall_gamma_n>("stage.wall_gamma_n", "N s/m", "0" + damped + "wall.gamma_n", ">= 0", "normal viscosity against walls"),
      row<&S::wall_gamma_t>("stage.wall_gamma_t", "N s/m", "0" + damped + "wall.gamma_t", ">= 0", "tangential viscosity against walls"),
      row<&S::restitution>("stage.restitution", "1", "contact.restitution", "0.05 .. 1", "coefficient of restitution of two grains"),
      row<&S::wall_restitution>("stage.wall_restitution", "1", "wall.restitution", "0.05 .. 1", "coefficient of restitution against walls"),
      row<&S::wall_mu>("stage.wall_mu", "1", "0" + damped + "stage.mu_d", ">= 0", "friction against walls"),
      row<&S::zero_kinematics>("stage.zero_kinematics", "", "true; another of its kind: false", "", "velocities, spins and rotations begin at zero; by default not where the stage before, or the last one of `start`, is of the same kind"),
      row<&S::clear_history>("stage.clear_history", "", "false", "", "tangential springs are forgotten when the stage begins"),
      row<&S::fluid>("stage.fluid", "", "fluid.enabled", "", "pore water in this stage"),
      row<&S::fluid_top>("stage.fluid_top", "", "\"drained\"", "drained | impermeable", "the top: at top_pressure, or tight (then the wall carries the water's pressure)"),
      load_row<&S::top_pressure, &S::top_pressure_history>("stage.top_pressure", "Pa", "", "over hydrostatic, at a drained top"),
      // clang-format on
  };
  append(of_stages, of_layers_and_water);
  append(of_stages,
         sinusoid_rows<&S::top_pressure_amplitude, &S::top_pressure_frequency, &S::top_pressure_phase>(
             "top_pressure", "Pa"));
  const std::vector<Key> of_floor{
      // clang-format off
      row<&S::fluid_bottom>("stage.fluid_bottom", "", "\"no_flow\"", "no_flow | pressure | flux", "the floor: tight, at bottom_pressure, or with bottom_flux through it"),
      load_row<&S::bottom_pressure, &S::bottom_pressure_history>("stage.bottom_pressure", "Pa", "", "over hydrostatic, at the floor"),
      // clang-format on
  };
  append(of_stages, of_floor);
  append(
      of_stages,
      sinusoid_rows<&S::bottom_pressure_amplitude, &S::bottom_pressure_frequency, &S::bottom_pressure_phase>(
          "bottom_pressure", "Pa"));
  append(table, of_stages);
  const std::vector<Key> of_flux_and_output{
      // clang-format off
      row<&S::bottom_flux>("stage.bottom_flux", "m/s", "0", "", "Darcy velocity through the floor, upwards"),

      records(row<output, &O::series_interval>("output.series_interval", "s", "0.05", "> 0", "of model time")),
      records(row<output, &O::snapshot_interval>("output.snapshot_interval", "s", "0.5", "> 0", "of model time")),
      no_physics(row<output, &O::checkpoint_interval>("output.checkpoint_interval", "s", "60", "> 0", "of wall clock")),

      no_physics(row<guards, &Guards::interval>("guards.interval", "", "20000", ">= 1", "steps between looks at the state; the engine itself looks for lost grains every 256")),
      no_physics(row<guards, &Guards::max_overlap>("guards.max_overlap", "1", "0.2", "> 0", "deepest overlap over the smaller radius; beyond it the run stops")),
      no_physics(row<guards, &Guards::max_residue>("guards.max_residue", "1", "0.1", "> 0", "energy created or lost over that stored and put in; beyond it the run stops")),
      // clang-format on
  };
  append(table, of_flux_and_output);
  return table;
}

// Insertions, deletions, substitutions and swaps of neighbours from one word to the other.
std::size_t edit_distance(const string& a, const string& b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i)
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      d[i][j] = std::min({d[i - 1][j - 1] + (a[i - 1] != b[j - 1]), d[i - 1][j] + 1, d[i][j - 1] + 1});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}

string leaf(const string& name) { return name.substr(name.find('.') + 1); }

bool in_range(const string& range, double value) {
  if (const auto dots = range.find(" .. "); dots != range.npos)
    return std::stod(range.substr(0, dots)) <= value && value <= std::stod(range.substr(dots + 4));
  if (range.starts_with(">= ")) return value >= std::stod(range.substr(3));
  if (range.starts_with("> ")) return value > std::stod(range.substr(2));
  return true;
}

// Each of the words in its name or meaning; in whatever case, and with spaces for underscores.
bool is_about(const Key& key, const std::vector<string>& words) {
  const auto plain = [](string text) {
    for (char& c : text) c = c == '_' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
  };
  const string text = plain(key.name + " " + key.meaning);
  // "stage.shear.mu_s", as it is set, is stage.mu_s in the table.
  const auto as_key = [](const string& word) {
    const auto first = word.find('.'), last = word.rfind('.');
    return is_list_of_tables(word.substr(0, first)) && last != word.npos
               ? word.substr(0, first) + word.substr(last)
               : word;
  };
  return std::all_of(words.begin(), words.end(),
                     [&](const string& word) { return text.find(plain(as_key(word))) != text.npos; });
}

string quoted(const string& text) {
  string out = "\"";
  for (const char c : text)
    if (c == '"' || c == '\\')
      out += '\\', out += c;
    else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      char code[8];
      std::snprintf(code, sizeof code, "\\u%04X", c);
      out += code;
    } else
      out += c;
  return out + '"';
}

}  // namespace

const std::vector<Key>& keys() {
  static const std::vector<Key> table = make_keys();
  return table;
}

const Key* find(const string& name) {
  const auto k = std::find_if(keys().begin(), keys().end(), [&](const Key& key) { return key.name == name; });
  return k == keys().end() ? nullptr : &*k;
}

bool is_list_of_tables(const string& table) {
  return table == "stage" || table == "material" || table == "pair";
}

string word_of(const Key& key) {
  const auto accepted = split(key.accepts, " | ");
  return key.type == Type::number && accepted.size() == 2 ? accepted[1] : "";
}

string or_word(const Key& key) { return word_of(key).empty() ? "" : ", or " + quoted(word_of(key)); }

string not_of_kind(const Key& key, const string& kind) {
  const auto kinds = split(key.kinds, ", ");
  if (key.kinds.empty() || std::find(kinds.begin(), kinds.end(), kind) != kinds.end()) return "";
  return "none: it belongs to kind " + key.kinds + ", and this stage is " + kind;
}

void check_range(const Key& key, const Value& value) {
  if (key.type == Type::choice) {
    const auto choices = split(key.accepts, " | ");
    const auto& text = std::get<string>(value);
    if (std::find(choices.begin(), choices.end(), text) == choices.end()) {
      const string near = nearest(text, choices);
      throw error("expected ", key.accepts, near.empty() ? "" : "; did you mean " + near + "?");
    }
  }
  const double* number = std::get_if<double>(&value);
  const std::int64_t* integer = std::get_if<std::int64_t>(&value);
  if ((number && !in_range(key.accepts, *number)) || (integer && !in_range(key.accepts, double(*integer))))
    throw error("expected ", split(key.accepts, " | ")[0],
                key.unit.empty() || key.unit == "1" ? "" : " " + key.unit, or_word(key));
  if (const Load* load = std::get_if<Load>(&value))
    for (const double one : load->history.value) check_range(key, one);
}

string suggestion(const string& unknown_key, const string& shown) {
  const string table = unknown_key.substr(0, unknown_key.find('.') + 1), unknown = leaf(unknown_key);
  std::vector<string> siblings, others;
  for (const Key& key : keys()) {
    if (key.table() != table && (key.table() == "material." || key.table() == "pair.")) continue;
    if (key.table() == table) siblings.push_back(leaf(key.name));
    others.push_back(key.name);
    // The right name in the wrong table.
    if (key.table() != table && leaf(key.name) == unknown) return "did you mean " + key.name + "?";
  }
  if (const string near = nearest(unknown, siblings); !near.empty())
    return "did you mean " + (shown.empty() ? table : shown) + near + "?";
  if (siblings.empty() || table.empty()) {
    // Of a name that lacks its table, what another table has that is near.
    string near = nearest(unknown_key, others);
    std::size_t least = unknown.size();
    for (const string& other : others)
      if (table.empty() && !nearest(unknown, {leaf(other)}).empty())
        if (const auto d = edit_distance(unknown, leaf(other)); d < least) least = d, near = other;
    return near.empty() ? "`moraine keys` lists all" : "did you mean " + near + "?";
  }
  return "known here: " + join(siblings, ", ");
}

string nearest(const string& word, const std::vector<string>& known) {
  string best;
  std::size_t least = (word.size() + 2) / 3 + 1;
  for (const string& k : known)
    if (const auto d = edit_distance(word, k); d < std::min(least, k.size())) least = d, best = k;
  return best;
}

std::vector<string> split(const string& text, const string& separator) {
  std::vector<string> parts;
  std::size_t begin = 0;
  for (std::size_t end; (end = text.find(separator, begin)) != text.npos; begin = end + separator.size())
    parts.push_back(text.substr(begin, end - begin));
  parts.push_back(text.substr(begin));
  return parts;
}

string join(const std::vector<string>& parts, const string& separator) {
  string text;
  for (const string& part : parts) text += (text.empty() ? "" : separator) + part;
  return text;
}

string to_toml(const Value& value) {
  if (const auto* text = std::get_if<string>(&value)) return quoted(*text);
  if (const auto* load = std::get_if<Load>(&value)) return to_toml(*load);
  if (const auto* flag = std::get_if<bool>(&value)) return *flag ? "true" : "false";
  if (const auto* integer = std::get_if<std::int64_t>(&value)) return std::to_string(*integer);
  if (const auto* list = std::get_if<std::vector<string>>(&value)) {
    std::vector<string> parts;
    for (const string& part : *list) parts.push_back(quoted(part));
    return "[" + join(parts, ", ") + "]";
  }
  char buffer[32];
  string text(buffer, std::to_chars(buffer, buffer + sizeof buffer, std::get<double>(value)).ptr);
  return text.find_first_of(".en") == text.npos ? text + ".0" : text;
}

string reference(const std::vector<string>& words) {
  const auto pad = [](string text, std::size_t width) {
    text.resize(std::max(text.size() + 1, width), ' ');
    return text;
  };
  string out =
      "The keys of case.toml: name, default and unit, meaning, (what is accepted), [kinds of stage].\n"
      "A value is a number in SI units or a text with a unit, such as \"80 kPa\".\n";
  string table = "none yet";
  bool found = false, with_presets = words.empty(), with_loads = words.empty();
  for (const Key& key : keys()) {
    if (!is_about(key, words)) continue;
    found = true, with_presets = with_presets || key.name == "model.preset";
    with_loads = with_loads || key.type == Type::load;
    if (key.table() != table) {
      table = key.table();
      const string name = table.substr(0, table.find('.'));
      if (!table.empty()) out += is_list_of_tables(name) ? "\n[[" + name + "]]\n" : "\n[" + name + "]\n";
    }
    out += "  " + pad(leaf(key.name), 25) + pad(key.fallback + (key.unit == "1" ? "" : " " + key.unit), 35) +
           key.meaning + (key.accepts.empty() ? "" : " (" + key.accepts + ")") +
           (key.kinds.empty() ? "" : " [" + key.kinds + "]") + "\n";
  }
  if (found) return out + (with_loads ? load_reference() : "") + (with_presets ? preset_reference() : "");
  std::vector<string> names;
  for (const Key& key : keys()) {
    names.push_back(leaf(key.name));
    if (!key.table().empty()) names.push_back(split(key.name, ".")[0]);
  }
  const string near = nearest(words.back(), names);
  throw error("keys ", join(words, " "), ": no key has ", words.size() > 1 ? "these words" : "this word",
              " in its name or meaning; ", near.empty() ? "" : "did you mean " + near + "? ",
              "`moraine keys` lists all");
}

}  // namespace moraine::cases
