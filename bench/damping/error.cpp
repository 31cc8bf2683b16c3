// The figures of bench/damping-error, as comma-separated lines on standard output:
//   problem,damping,finer,error    finer: how many steps one of w dt = 0.1 is cut into
#include <cstdio>
#include <functional>
#include <string>

#include "physics/scenes.hpp"

using namespace moraine::dem;

namespace {

constexpr double k = 1e5, r = 0.01, v_0 = 0.1;
constexpr int finest = 256;  // for the solutions that others are measured by
const auto engine = make_engine(Backend::cpu, 1);

using Error = std::function<double(int finer)>;

void rows(const std::string& problem, double damping, const Error& error) {
  for (const int finer : {1, 2, 4, 8, 16})
    std::printf("%s,%g,%d,%.6g\n", problem.c_str(), damping, finer, error(finer));
  std::fflush(stdout);
}

// Two equal grains; w = sqrt(2 k/m), and damping is gamma/(m w), its share of the critical one.
struct Pair {
  Scene s = empty_space(k);
  double m = mass(s, r), w = std::sqrt(2 * k / m);
  explicit Pair(double damping) {
    const double gamma = damping * m * w;
    s.contact.fill(LinearContact{k, 0.6 * k, gamma, 0.5 * gamma, 100, 100});
    s.body(BodyId::floor) = {};
  }
  void cut(int finer) { s.dt = 0.1 / w / finer; }
};

template <class Spring>
void remember(Spring& spring, const Vec3d& v) {  // in versions whose contacts do
  if constexpr (requires { spring.v_before; }) spring.v_before = v;
}
// The start as if the contacts, of equal grains, had been there half a step ago; else this is their first
// step.
State under_way(const Scene& s, const State& start) {
  State now = run(*engine, s, start, 0);
  for (Contact& c : now.contacts) {
    const Vec3d v = now.v[c.i] - now.v[c.j], x = axpy(-0.5 * s.dt, v, now.x[c.i] - now.x[c.j]);
    remember(c.spring, v + 0.5 * cross(x, now.omega[c.i] + now.omega[c.j]));
  }
  for (WallContact& c : now.wall_contacts) remember(c.spring, now.v[c.i]);
  return now;
}

State at_end(const Scene& s, const State& start, double end) {
  State now = run(*engine, s, start, std::llround(end / s.dt));
  synchronise(s, now);
  return now;
}

// Where in a step contact begins is chance: the root mean square over the share of a step that is left.
double over_phases(const std::function<double(double)>& error) {
  double sum = 0;
  constexpr int phases = 16;
  for (int p = 0; p < phases; ++p) sum += std::pow(error((p + 0.5) / phases), 2);
  return std::sqrt(sum / phases);
}

// Head-on: m* xi'' + gamma xi' + k xi = 0 until the force would pull (tests/physics/test_two_grains.cpp).
double restitution(double b) {
  const double c = std::sqrt(std::abs(1 - b * b));
  return std::exp(-b * (b < 1 ? std::atan2(2 * b * c, b * b - c * c) / c : std::log((b + c) / (b - c)) / c));
}
double head_on(double damping, int finer) {
  Pair pair(damping);
  pair.cut(finer);
  return over_phases([&](double left) {
    State start = grains_at_rest({r, r}, {{0, 0, 0}, {2 * r + left * v_0 * pair.s.dt, 0, 0}});
    start.v[0].x = v_0;
    const State now = at_end(pair.s, start, 20 / pair.w);
    return (now.v[1].x - now.v[0].x) / v_0 - restitution(damping);
  });
}

// A grain lands on a floor while something as strong as the contact pushes it: g = v_0 w.
double pushed_landing(double damping, int finer, double exact) {
  Pair pair(damping);
  Scene& s = pair.s;
  const double w = std::sqrt(k / pair.m), gamma = 2 * damping * pair.m * w;
  s.body(BodyId::floor) = floor_at(0);
  s.contact.fill(LinearContact{k, 0, gamma, 0, 0, 0});
  s.gravity = v_0 * w, s.dt = 0.1 / w / finer;
  return over_phases([&](double left) {
    const double t = left * s.dt;  // until it touches, then at v_0
    State start = grains_at_rest({r}, {{0, 0, r + v_0 * t - 0.5 * s.gravity * t * t}});
    start.v[0].z = -v_0 + s.gravity * t;
    const double end = 1 / w + t;
    State now = at_end(s, start, std::llround(1 / w / s.dt) * s.dt);
    const double late = end - std::llround(1 / w / s.dt) * s.dt;  // the rest of the time, by Taylor's series
    const double a = now.force[0].z / pair.m - s.gravity;
    return ((now.x[0].z - r + late * now.v[0].z + 0.5 * late * late * a) / (v_0 / w) - exact);
  });
}
// x'' + 2 b x' + x = -1 from x = 0, x' = -1, at t = 1.
double landing(double b) {
  const double c = std::sqrt(std::abs(1 - b * b));
  const double cosine = b < 1 ? std::cos(c) : std::cosh(c), sine = b < 1 ? std::sin(c) : std::sinh(c);
  return -1 + std::exp(-b) * (cosine + (b - 1) / c * sine);
}

// A grain pressed between floor and wall swings; displaced to begin with, or pushed.
double swing(double damping, int finer, bool pushed, bool first) {
  Pair pair(damping);
  const double overlap = 1e-3 * r, a = 0.3 * overlap, b = damping, c = std::sqrt(std::abs(1 - b * b));
  pair.s.body(BodyId::floor) = floor_at(0), pair.s.body(BodyId::top_wall) = wall_at_rest();
  pair.s.contact.fill(LinearContact{k, 0, damping * pair.m * pair.w, 0, 0, 0});
  pair.cut(finer);
  State now = grains_at_rest({r}, {{0, 0, r - overlap + (pushed ? 0 : a)}});
  now.wall_z() = 2 * (r - overlap);
  if (pushed) now.v[0].z = a * pair.w;
  double worst = 0;
  engine->load(pair.s, first ? now : under_way(pair.s, now));
  for (int n = finer; n <= 60 * finer; n += finer) {  // to w t = 6
    engine->advance(finer);
    const double t = 0.1 * n / finer, fall = std::exp(-b * t);
    const double cosine = b < 1 ? std::cos(c * t) : std::cosh(c * t),
                 sine = (b < 1 ? std::sin(c * t) : std::sinh(c * t)) / c;
    const double exact = fall * (pushed ? sine : cosine + b * sine);
    worst = std::max(worst, std::abs((engine->state().x[0].z - r + overlap) / a - exact));
  }
  return worst;
}

// Pressed into one another by 3 %, moving obliquely, spinning about all axes, for w t = 1.2.
State oblique(double damping, int finer, bool first) {
  Pair pair(damping);
  pair.cut(finer);
  State start = grains_at_rest({r, r}, {Vec3d{0, 0, 0}, 0.97 * 2 * r * Vec3d{1.0 / 3, 2.0 / 3, 2.0 / 3}});
  const double v = 0.02 * r * pair.w;
  start.v[0] = v * Vec3d{1.0, -0.3, 0.9}, start.v[1] = v * Vec3d{0.2, -0.7, 0.1};
  start.omega[0] = v / r * Vec3d{1, 2, -3}, start.omega[1] = v / r * Vec3d{0.5, -2, 1.5};
  return at_end(pair.s, first ? start : under_way(pair.s, start), 1.2 / pair.w);
}
double difference(const State& a, const State& b, const std::vector<Vec3d> State::*q) {
  double sum = 0, size = 0;
  for (Index i = 0; i < a.size(); ++i) sum += length((a.*q)[i] - (b.*q)[i]), size += length((b.*q)[i]);
  return sum / size;
}

double balance(const Scene& scene, const State& s) {
  const Ledger& l = s.ledger;
  return observe(scene, s).energy.total() + l.slip + l.viscous - l.planes - l.layers;
}
// Root mean square of what is missing, over what the contacts took.
double residue(Bed bed, int steps, int finer) {
  bed.scene.dt /= finer;
  engine->load(bed.scene, bed.state);
  const double start = balance(bed.scene, engine->state());
  double sum = 0;
  constexpr int looks = 20;
  State now;
  for (int look = 0; look < looks; ++look) {
    engine->advance(std::int64_t(steps) / looks * finer);
    now = engine->state();
    sum += std::pow(balance(bed.scene, now) - start, 2);
  }
  return std::sqrt(sum / looks) / (now.ledger.slip + now.ledger.viscous);
}

Bed damp(Bed bed, double damping) {
  Scene& s = bed.scene;
  const double gamma = damping * 2 * std::sqrt(0.5 * mass(s, r) * k);
  s.with(Material::grain).gamma_n = gamma, s.with(Material::grain).gamma_t = 0.4 * gamma;
  return bed;
}
Bed falling_bed(int seed) {
  Packing p;
  p.count = 300, p.columns_x = p.columns_y = 5;
  p.radius_mean = r, p.radius_std = 0.0005, p.cell = 1.06, p.seed = seed;
  const Lattice lattice = make_lattice(p);
  Bed bed{settled_bed().scene, lattice.state};
  bed.scene.box = {lattice.box_x, lattice.box_y, 1};
  sort_spatially(bed.scene, bed.state);
  return bed;
}

}  // namespace

int main() {
  std::puts("problem,damping,finer,error");
  for (const double b : {0.05, 0.3, 0.8, 1.5}) {
    rows("two grains head-on: restitution", b, [&](int finer) { return head_on(b, finer); });
    rows("a grain that is pushed lands: place", b,
         [&](int finer) { return pushed_landing(b, finer, landing(b)); });
    for (const bool first : {true, false}) {
      const auto named = [&](const char* what) {
        return std::string(what) + (first ? " from a start" : " under way");
      };
      rows(named("pressed grain let go: place"), b, [&](int finer) { return swing(b, finer, false, first); });
      rows(named("pressed grain kicked: place"), b, [&](int finer) { return swing(b, finer, true, first); });
      const State exact = oblique(b, finest, first);
      const auto off = [&](const std::vector<Vec3d> State::*q) {
        return [&, q](int finer) { return difference(oblique(b, finer, first), exact, q); };
      };
      rows(named("oblique pressed pair: velocity"), b, off(&State::v));
      rows(named("oblique pressed pair: spin"), b, off(&State::omega));
    }
  }
  for (const double b : {0.1, 0.3, 0.8}) {
    rows("bed falls and settles: residue", b, [&](int finer) {
      double sum = 0;
      for (const int seed : {1, 2, 3}) sum += std::pow(residue(damp(falling_bed(seed), b), 4000, finer), 2);
      return std::sqrt(sum / 3);
    });
    rows("bed is sheared: residue", b,
         [&](int finer) { return residue(damp(sheared_bed(), b), 2000, finer); });
  }
}
