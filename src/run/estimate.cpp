#include "run/estimate.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <functional>
#include <random>

#include "dem/memory_order.hpp"
#include "dem/observe.hpp"
#include "dem/packing.hpp"
#include "error.hpp"
#include "run/schedule.hpp"

namespace moraine::run {

namespace {

using Kind = cases::Stage::Kind;

constexpr double most_grains = 20000;  // that are timed; the cost of more goes with their number
constexpr double slower = 1e-4;        // by which a step is shortened while it is timed
constexpr double timed_for = 0.15;     // s, each bed
constexpr double loosest = 0.42, squeeze = 0.99, dense = 6.5;  // porosity, of the height, contacts a grain
constexpr int most_squeezes = 60;
constexpr double widest =
    4;  // largest over smallest grain: scattered evenly, small ones would lie within large ones
constexpr int chunks = 9;  // of which the median counts, so that a busy moment does not

// Contacts a grain: 3 to 5 at the end of settling (friction, damping), 5 consolidated; 3.7 to 4 in shear, 4.7
// where water keeps the bed from dilating (cases/quick-shear, cases/paper-2013, cases/till/quick-undrained).
double expected_contacts(const cases::Stage& stage) {
  if (!shears(stage.kind)) return 5;
  return stage.fluid && stage.fluid_top == cases::Stage::FluidTop::impermeable ? 4.7 : 4;
}

// A narrower box of the same height where there are more grains than are timed.
Start narrower(Start s) {
  const dem::State all = s.before.state;
  const double r_max = *std::max_element(all.r.begin(), all.r.end());
  const double share = std::max(std::sqrt(most_grains / static_cast<double>(all.size())),
                                8 * r_max / std::min(s.box_x, s.box_y));
  if (share >= 1) return s;
  s.box_x *= share, s.box_y *= share;
  std::vector<double> r;
  std::vector<dem::Vec3d> x;
  for (dem::Index i = 0; i < all.size(); ++i)
    if (all.x[i].x < s.box_x && all.x[i].y < s.box_y) r.push_back(all.r[i]), x.push_back(all.x[i]);
  s.before.state = dem::grains_at_rest(std::move(r), std::move(x));
  return s;
}

bool is_wide(const std::vector<double>& r) {
  const auto [smallest, largest] = std::minmax_element(r.begin(), r.end());
  return *largest > widest * *smallest;
}

// As many, of the same volume together.
Start in_one_size(Start s) {
  std::vector<double>& r = s.before.state.r;
  double cubes = 0;
  for (const double radius : r) cubes += radius * radius * radius;
  std::fill(r.begin(), r.end(), std::cbrt(cubes / static_cast<double>(r.size())));
  return s;
}

// At random, but evenly, below `height`.
std::vector<dem::Vec3d> scattered(const std::vector<double>& r, double box_x, double box_y, double height) {
  const auto n = static_cast<std::int64_t>(r.size());
  const double side = std::cbrt(box_x * box_y * height / static_cast<double>(n));
  const auto nx = std::max<std::int64_t>(1, std::llround(box_x / side)),
             ny = std::max<std::int64_t>(1, std::llround(box_y / side)), nz = (n + nx * ny - 1) / (nx * ny);
  std::mt19937_64 random(1);
  const auto share = [&] { return 0.2 + 0.6 * (static_cast<double>(random() >> 11) * 0x1p-53); };
  std::vector<dem::Vec3d> x(r.size());
  for (std::int64_t i = 0; i < n; ++i)
    x[i] = {box_x / static_cast<double>(nx) * (static_cast<double>(i % nx) + share()),
            box_y / static_cast<double>(ny) * (static_cast<double>(i / nx % ny) + share()),
            std::clamp(height / static_cast<double>(nz) * (static_cast<double>(i / (nx * ny)) + share()),
                       r[i], height - r[i])};
  return x;
}

double contacts_each(const dem::State& s) { return 2.0 * static_cast<double>(s.contacts.size()) / s.size(); }

double median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}

}  // namespace

Estimate::Estimate(const cases::Case& c, const Start& start, dem::Engine& engine)
    : case_(c),
      loose_(c.start.empty() && c.floor && !c.periodic_z),
      one_size_(loose_ && is_wide(start.before.state.r)),
      start_(one_size_         ? in_one_size(narrower(start))
             : c.start.empty() ? narrower(start)
                               : start),
      engine_(engine),
      scale_(static_cast<double>(start.before.state.size()) / start_.before.state.size()),
      packed_(start_.before.state) {}

void Estimate::pack() {
  const std::vector<double>& r = start_.before.state.r;
  dem::Scene scene;
  scene.box = {start_.box_x, start_.box_y, 0};
  scene.density.fill(case_.grains.density), scene.gravity = 0, scene.ledger = false;
  const double r_min = *std::min_element(r.begin(), r.end());
  const double mass = scene.inertial_mass(r_min, dem::Material::grain);
  const double k_n = dem::stiffness_of(case_.contact, dem::usual_contact(r_min, r_min));
  scene.dt = 0.15 * std::sqrt(mass / k_n);
  dem::ContactParameters smooth;
  smooth.k_n = k_n, smooth.gamma_n = 0.5 * std::sqrt(mass * k_n);
  smooth.k_t = smooth.mu_s = smooth.mu_d = 0;
  scene.contact.fill(smooth);
  scene.body(dem::BodyId::top_wall) = dem::top_wall();
  scene.body(dem::BodyId::top_wall).z = dem::Drive::at(0);
  double volume = 0;
  for (const double radius : r) volume += dem::sphere_volume(radius);
  double height = volume / (1 - loosest) / scene.area();
  packed_ = dem::grains_at_rest(r, scattered(r, start_.box_x, start_.box_y, height));
  for (int k = 0; k < most_squeezes && contacts_each(packed_) < dense; ++k) {
    dem::State next = dem::grains_at_rest(packed_.r, packed_.x);
    if (k > 0) {
      height *= squeeze;
      for (dem::Vec3d& x : next.x) x.z *= squeeze;
    }
    next.wall_z() = height;
    dem::sort_spatially(scene, next);
    engine_.load(scene, next);
    engine_.advance(k == 0 ? 400 : 40);
    packed_ = engine_.state();
  }
}

// The bed with its radii shrunk, or swollen, until grains have so many contacts each.
dem::State Estimate::with_contacts(double each) const {
  const dem::Vec3d box{start_.box_x, start_.box_y, 0};
  std::vector<double> overlaps;  // over the sum of the radii
  for (const dem::Contact& c : packed_.contacts) {
    dem::Vec3d d = packed_.x[c.i] - packed_.x[c.j];
    for (int a = 0; a < 2; ++a) d[a] -= box[a] * std::round(d[a] / box[a]);
    overlaps.push_back(1 - std::sqrt(dot(d, d)) / (packed_.r[c.i] + packed_.r[c.j]));
  }
  dem::State bed = dem::grains_at_rest(packed_.r, packed_.x);
  const auto wanted = static_cast<std::size_t>(each * packed_.size() / 2);
  if (wanted >= overlaps.size()) return bed;
  std::nth_element(overlaps.begin(), overlaps.begin() + static_cast<std::ptrdiff_t>(wanted), overlaps.end(),
                   std::greater<>());
  for (double& r : bed.r) r *= 1 - overlaps[wanted];
  return bed;
}

// s a step of the stage, on a bed whose fastest grain moves at this speed.
double Estimate::per_step(const Stage& stage, dem::State bed, double speed) {
  dem::Scene scene = stage.scene;
  std::unique_ptr<coupling::PoreWater> water;
  if (stage.water.present) {  // exchanges as often as in the run, which goes by the true step
    Stage wet = stage;
    engine_.load(wet.scene, bed);  // for its contacts
    bed.contacts = engine_.state().contacts;
    water = fill(wet, bed, {}, false);
    wet.water.interval = water->interval();
    wet.water.viscosity *= slower;  // so that as much flows in a step
    wet.scene.dt *= slower;
    water = coupling::make_pore_water(wet.water, wet.scene, bed, {}, false);
    scene.exchange_interval = water->interval();
  }
  scene.dt *= slower;
  for (dem::Body& body : scene.bodies)
    for (int a = 0; a < 3; ++a) body.along(a).velocity /= slower;
  double fastest = std::max({speed, std::abs(stage.scene.body(dem::BodyId::top_layer).x.velocity), 1e-9});
  for (dem::Vec3d& v : bed.v) fastest = std::max(fastest, std::sqrt(dot(v, v))), v = (1 / slower) * v;
  bed.v[bed.size() / 2] = {speed / slower, 0, 0};
  // As long as the bed is still what it was: none has moved by more than half a diameter (and none falls
  // through the floor).
  const std::int64_t least = std::max<std::int64_t>(1, scene.exchange_interval);
  const auto most =
      static_cast<std::int64_t>(std::clamp(0.5 * stage.diameter / (fastest * stage.scene.dt), 1.0, 1e9));
  const std::int64_t limit = std::max(least, most / least * least);
  std::int64_t left = 0;
  const auto time = [&](std::int64_t steps) {
    if (left < steps) engine_.load(scene, bed, water.get()), left = limit;
    left -= steps;
    const double began = processor_time();
    engine_.advance(steps);
    return processor_time() - began;
  };
  std::int64_t steps = least;
  while (time(steps) < timed_for / chunks && 2 * steps <= limit) steps *= 2;
  std::vector<double> each;
  for (int k = 0; k < chunks; ++k) each.push_back(time(steps) / static_cast<double>(steps));
  return median(each);
}

// s, of this process, over its threads: what others do on the machine does not count. By the clock where it
// is a GPU that works.
double Estimate::processor_time() const {
  const bool here = !engine_.describe().starts_with("cuda");
  timespec now;
  clock_gettime(here ? CLOCK_PROCESS_CPUTIME_ID : CLOCK_MONOTONIC, &now);
  return (static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec)) /
         (here ? engine_.threads() : 1);
}

// Of loads that change the largest, for good: what is timed is as fast as the stage at its fastest.
static void hold_largest(const cases::Stage& wanted, dem::Scene& scene) {
  dem::Drive &wall = scene.body(dem::BodyId::top_wall).z, &layer = scene.body(dem::BodyId::top_layer).x;
  if (wanted.normal_stress_history.is_there()) wall.mean = wanted.normal_stress;
  if (wanted.shear_stress_history.is_there()) layer.mean = wanted.shear_stress;
  layer.velocity = layer_velocity(wanted, scene);
  if (layer.kind == dem::Drive::Kind::velocity) layer.amplitude = 0;
  for (dem::Drive* drive : {&wall, &layer}) drive->rate = 0, drive->piecewise = false;
}

Estimate::Time Estimate::stage(std::size_t index, double duration, double dt) {
  const cases::Stage& wanted = case_.stages[index];
  if (loose_ && packed_.contacts.empty()) pack();
  dem::State bed = loose_ ? with_contacts(expected_contacts(wanted)) : packed_;
  output::Checkpoint now = start_.before;
  if (index > 0) take_layers_away(now.scene);  // with layers of its own
  if (index > 0) now.scene.box = {start_.box_x, start_.box_y, start_.box_z};
  now.state = std::move(bed);
  Stage stage = prepare(case_, index, start_, now);
  bed = std::move(now.state);
  if (stage.goes_on) {  // to be timed as any other
    dem::synchronise(stage.scene, bed);
    bed.step = 0, bed.water_force.clear(), bed.water = {};
    stage.scene.exchange_interval = 0;
  }
  if (one_size_) stage.scene.dt = dt;
  hold_largest(wanted, stage.scene);
  const double steps = std::max(1.0, std::round(duration / stage.scene.dt));
  double speed = 0;  // m/s, of the fastest grain
  if (wanted.kind == Kind::shear) speed = 3 * std::abs(layer_velocity(wanted, stage.scene));
  if (wanted.normal_stress > 0)  // what the wall has pushed comes to rest in a small part of the stage
    speed = std::max(speed, 0.02 * std::sqrt(wanted.normal_stress / case_.grains.density));
  const double way = bed_top(start_.before.state) - bed_top(bed);
  const bool falls = loose_ && !one_size_ && index == 0 && way > 0 && case_.gravity > 0 &&
                     !stage.scene.has(dem::BodyId::top_wall);
  const double each = falls ? falling(stage, bed, way, duration) : per_step(stage, bed, speed);
  return {steps, scale_ * (steps * each + rows(stage, bed, duration))};
}

// s a step, mean over the stage.
double Estimate::falling(const Stage& stage, const dem::State& bed, double way, double duration) {
  const double g = case_.gravity, landed = std::sqrt(2 * way / g), v_end = g * landed;
  const double high = bed_top(start_.before.state), low = bed_top(bed);
  dem::State apart = with_contacts(0.5);  // what has landed still bounces
  dem::sort_spatially(stage.scene, apart);
  double sum = 0, until = 0;  // s, of steps over the time they stand for
  const auto add = [&](double time, const dem::State& s, double speed) {
    const double part = std::clamp(duration - until, 0.0, time);
    if (part > 0) sum += part * per_step(stage, s, speed);
    until += time;
  };
  constexpr int parts = 4;
  for (int k = 0; k < parts; ++k) {
    const double t = landed * (k + 0.5) / parts, fallen = 0.5 * g * t * t, share = std::pow(t / landed, 2);
    std::vector<double> r;
    std::vector<dem::Vec3d> x;
    std::vector<bool> falls;
    for (dem::Index i = 0; i < apart.size(); ++i)
      if (apart.x[i].z < share * low)
        r.push_back(apart.r[i]), x.push_back(apart.x[i]), falls.push_back(false);
    for (dem::Index i = 0; i < start_.before.state.size(); ++i)
      if (const dem::Vec3d& at = start_.before.state.x[i]; at.z >= share * high)
        r.push_back(start_.before.state.r[i]), x.push_back({at.x, at.y, at.z - fallen}),
            falls.push_back(true);
    dem::State now = dem::grains_at_rest(std::move(r), std::move(x));
    for (dem::Index i = 0; i < now.size(); ++i)
      if (falls[i]) now.v[i].z = -g * t;
    dem::sort_spatially(stage.scene, now);
    add(landed / parts, now, g * t);
  }
  add(landed / 2, apart, v_end / 2), add(landed / 2, bed, v_end / 2);
  add(std::max(0.0, duration - until), bed, 0.01 * v_end);
  return sum / duration;
}

// s, of what is read off for the series.
double Estimate::rows(const Stage& stage, const dem::State& bed, double duration) {
  dem::Scene scene = stage.scene;
  scene.exchange_interval = 0, scene.fluid_density = 0;
  engine_.load(scene, bed);
  const double began = processor_time();
  dem::observe(scene, engine_.state());
  return (processor_time() - began) * std::ceil(duration / stage.series_interval);
}

}  // namespace moraine::run
