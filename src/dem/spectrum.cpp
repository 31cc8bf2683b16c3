#include "dem/spectrum.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <map>

#include "dem/body/motion.hpp"
#include "dem/leapfrog.hpp"

namespace moraine::dem {

namespace {

constexpr double accuracy = 0.01;  // of the residual
constexpr int most_iterations = 300;

using Vector = std::vector<double>;  // one number a degree of freedom

double inner(const Vector& a, const Vector& b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum = fma(a[k], b[k], sum);
  return sum;
}

// What resists motion at a contact: a spring's k (N/m, N m) or a dashpot's gamma.
struct Resistance {
  double normal, tangential;
  double rolling, twisting;  // of the couple, against the difference of both spins
};
Resistance springs(const ContactParameters& p, const Geometry<double>& g) {
  const auto at = patch<GeneralLaw>(p, g);
  const double arm2 = at.radius * at.radius;
  return {GeneralLaw::Normal::stiffness(p, at.at()), p.mu_s > 0 ? GeneralLaw::Normal::k_t(p, at.at()) : 0,
          Rolling::used(p) ? arm2 * p.k_roll : 0, Twisting::used(p) ? arm2 * p.k_twist : 0};
}
Resistance dashpots(const ContactParameters& p, const Geometry<double>& g) {
  const auto at = patch<GeneralLaw>(p, g);
  const double gamma_n = p.zeta > 0 ? Restitution::gamma_n<GeneralLaw::Normal>(p, g, at.at()) : p.gamma_n;
  return {gamma_n, p.mu_s > 0 ? p.gamma_t : 0, 0, 0};
}
using ResistanceOf = Resistance (*)(const ContactParameters&, const Geometry<double>&);

// v -> M^-1/2 K M^-1/2 v, contact by contact. Held directions have an infinite mass.
class Network {
 public:
  Network(const Scene& scene, const State& s)
      : scene_(scene),
        n_(s.size()),
        freedoms_(6 * s.size() + 2),
        part_of_(s.part_of),
        motion_(2 * s.size() + 1) {
    const auto root = [](double inverse_mass) { return std::sqrt(inverse_mass); };
    double layer_mass = 0;
    for (Index i = 0; i < n_; ++i) {
      const Mobility m = mobility(scene, s.r[i], s.material_of(i), s.part_of[i]);
      const double xy = root(m.inverse_mass_xy), spin = root(m.inverse_inertia);
      root_.push_back({xy, xy, root(m.inverse_mass_z)});
      root_.push_back({spin, spin, spin});
      if (s.part_of[i] == BodyId::top_layer) layer_mass += scene.inertial_mass(s.r[i], s.material_of(i));
    }
    const Body &wall = scene.body(BodyId::top_wall), &layer = scene.body(BodyId::top_layer);
    if (wall.z.kind == Drive::Kind::stress) wall_root_ = root(1 / wall.mass);
    if (layer.x.kind == Drive::Kind::stress && layer_mass > 0) layer_root_ = root(1 / layer_mass);

    const Sides sides = Sides::of(scene);
    for (const Contact& c : s.contacts)
      bonds_.push_back({c.i, c.j, pair_number(s.material_of(c.i), s.material_of(c.j)), false,
                        between_grains(nearest_image(sides, s.x[c.i] - s.x[c.j]), s.r[c.i] + s.r[c.j],
                                       s.r[c.i] - s.r[c.j])});
    for (const WallContact& w : s.wall_contacts) {
      const Body& plane = scene.body(w.wall);
      if (!plane.is_there()) continue;
      const Geometry<double> g =
          at_plane(s.x[w.i], s.r[w.i], plane.axis, place_of(scene, s, w.wall), plane.facing);
      bonds_.push_back({w.i, w.wall == BodyId::top_wall ? n_ : -1,
                        pair_number(s.material_of(w.i), plane.material), true, g});
    }
  }

  std::size_t freedoms() const { return freedoms_; }
  bool empty() const { return bonds_.empty(); }

  // y = A v
  void apply(ResistanceOf resistance, const Vector& v, Vector& y) {
    for (Index k = 0; k < 2 * n_; ++k)
      for (int a = 0; a < 3; ++a) motion_[k][a] = root_[k][a] * v[3 * k + a];
    const double layer = layer_root_ * v[6 * n_ + 1];
    if (layer_root_ > 0)
      for (Index i = 0; i < n_; ++i)
        if (part_of_[i] == BodyId::top_layer) motion_[2 * i].x = layer;
    motion_[2 * n_] = {0, 0, wall_root_ * v[6 * n_]};

    std::vector<Vec3d>& load = load_;
    load.assign(motion_.size(), Vec3d{0, 0, 0});
    for (const Bond& b : bonds_)
      resist(b, resistance(scene_.contact[static_cast<std::size_t>(b.materials)], b.g), load);

    double layer_force = 0;
    for (Index i = 0; i < n_; ++i)
      if (part_of_[i] == BodyId::top_layer) layer_force += load[2 * i].x;
    for (Index k = 0; k < 2 * n_; ++k)
      for (int a = 0; a < 3; ++a) y[3 * k + a] = root_[k][a] * load[k][a];
    y[6 * n_] = wall_root_ * load[2 * n_].z;
    y[6 * n_ + 1] = layer_root_ * layer_force;
  }

 private:
  struct Bond {
    Index i, j;     // j = n_: top wall, -1: a plane that stands still
    int materials;  // pair_number
    bool at_plane;
    Geometry<double> g;
  };

  // Rows of motion_ and load: 2 i moves and 2 i + 1 turns grain i, the last is the top wall.
  void resist(const Bond& b, const Resistance& k, std::vector<Vec3d>& load) const {
    const Geometry<double>& g = b.g;
    const Vec3d still{0, 0, 0};
    const Vec3d v_j = b.j < 0 ? still : motion_[2 * b.j], omega_j = b.at_plane ? still : motion_[2 * b.j + 1];
    const Vec3d v = motion_[2 * b.i] - v_j;
    const Vec3d v_c = v + cross(g.n, axpy(g.l_i, motion_[2 * b.i + 1], g.l_j * omega_j));
    const Vec3d f_t = k.tangential * less(v_c, dot(v_c, g.n), g.n);
    const Vec3d f = axpy(k.normal * dot(v, g.n), g.n, f_t), moment = cross(g.n, f_t);
    load[2 * b.i] += f;
    load[2 * b.i + 1] -= g.l_i * moment;
    if (b.j >= 0) load[2 * b.j] -= f;
    if (!b.at_plane) load[2 * b.j + 1] -= g.l_j * moment;
    if (k.rolling == 0 && k.twisting == 0) return;
    const Vec3d spin = motion_[2 * b.i + 1] - omega_j, twist = dot(spin, g.n) * g.n;
    const Vec3d couple = axpy(k.rolling, spin - twist, k.twisting * twist);
    load[2 * b.i + 1] += couple;
    if (!b.at_plane) load[2 * b.j + 1] -= couple;
  }

  const Scene& scene_;
  Index n_;
  std::size_t freedoms_;
  std::vector<BodyId> part_of_;
  std::vector<Vec3d> root_;  // 1/sqrt(kg), 1/sqrt(kg m2)
  double wall_root_ = 0, layer_root_ = 0;
  std::vector<Bond> bonds_;
  std::vector<Vec3d> motion_, load_;
};

// The symmetric tridiagonal matrix that Lanczos builds: `a` on the diagonal, `b` beside it.
struct Tridiagonal {
  std::vector<double> a, b;

  // Last pivot of t - T; not positive, or not a number, where t is not above all eigenvalues.
  double last_pivot(double t) const {
    double d = t - a[0];
    for (std::size_t k = 1; k < a.size() && d > 0; ++k) d = t - a[k] - b[k - 1] * b[k - 1] / d;
    return d;
  }
  double largest_eigenvalue() const {
    double low = 0, high = 0;
    for (std::size_t k = 0; k < a.size(); ++k) {
      low = std::max(low, a[k]);
      high = std::max(high, a[k] + (k > 0 ? b[k - 1] : 0) + (k < b.size() ? b[k] : 0));
    }
    high *= 1 + 1e-15;
    while (high - low > 1e-13 * high) {
      const double middle = 0.5 * (low + high);
      (last_pivot(middle) > 0 ? high : low) = middle;
    }
    return high;
  }
  // Not less than the last component of that eigenvector: the last diagonal entry of (t - T)^-1 is 1/pivot,
  // and at least component^2/(t - eigenvalue) for any t above.
  double last_component(double eigenvalue) const {
    const double above = 1e-8 * eigenvalue;
    return std::min(1.0, std::sqrt(above / last_pivot(eigenvalue + above)));
  }
};

// A start that is near no eigenvector's orthogonal plane, the same on every machine.
Vector start_vector(std::size_t size) {
  Vector v(size);
  std::uint64_t random = 0;
  for (double& x : v) {  // splitmix64
    std::uint64_t z = random += 0x9e3779b97f4a7c15;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    x = static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1;
  }
  return v;
}

// Largest eigenvalue plus the residual of its vector. Without reorthogonalisation: that repeats eigenvalues
// and invents none.
double largest_eigenvalue(Network& network, ResistanceOf resistance) {
  if (network.empty()) return 0;
  const auto apply = [&](const Vector& v, Vector& y) { network.apply(resistance, v, y); };
  Vector v, before(network.freedoms(), 0), next(network.freedoms());
  apply(start_vector(network.freedoms()), next);  // leaves the part that no contact resists behind
  v = next;
  double norm = std::sqrt(inner(v, v));
  if (!(norm > 0)) return 0;
  for (double& x : v) x /= norm;

  Tridiagonal t;
  double beta = 0;
  for (int k = 1;; ++k) {
    apply(v, next);
    const double alpha = inner(v, next);
    for (std::size_t f = 0; f < v.size(); ++f) next[f] = fma(-alpha, v[f], fma(-beta, before[f], next[f]));
    beta = std::sqrt(inner(next, next));
    t.a.push_back(alpha);
    const double theta = t.largest_eigenvalue();
    const double residual = beta * t.last_component(theta);
    if (residual < accuracy * theta || k == most_iterations) return theta + residual;
    t.b.push_back(beta);
    before = v;
    for (std::size_t f = 0; f < v.size(); ++f) v[f] = next[f] / beta;
  }
}

double critical_step(double w2, double c) { return 2 / (c + std::sqrt(c * c + w2)); }

// One contact of grains with these sums of 1/m and of 1/I, with an arm l.
double critical_step(const ContactParameters& p, const Geometry<double>& g, double inverse_mass,
                     double inverse_inertia, double arm) {
  const auto largest = [&](const Resistance& k) {
    return std::max({k.normal * inverse_mass, k.tangential * (inverse_mass + arm * arm * inverse_inertia),
                     std::max(k.rolling, k.twisting) * inverse_inertia});
  };
  return critical_step(largest(springs(p, g)), largest(dashpots(p, g)));
}

}  // namespace

Spectrum spectrum(const Scene& scene, const State& state) {
  Network network(scene, state);
  Spectrum s;
  s.stiffness = largest_eigenvalue(network, springs);
  if (std::any_of(scene.contact.begin(), scene.contact.end(),
                  [](const ContactParameters& p) { return Restitution::used(p); }))
    s.damping = largest_eigenvalue(network, dashpots);
  return s;
}

double critical_step(const Spectrum& s) {
  if (!(s.stiffness > 0)) return std::numeric_limits<double>::infinity();
  return critical_step(s.stiffness, s.damping);
}

double one_contact_step(const Scene& scene, const State& s) {
  struct Grain {
    double r, m;  // m, kg
  };
  std::map<Material, Grain> lightest;
  for (Index i = 0; i < s.size(); ++i) {
    const Grain grain{s.r[i], scene.inertial_mass(s.r[i], s.material_of(i))};
    const auto [at, first] = lightest.emplace(s.material_of(i), grain);
    if (grain.m < at->second.m || (grain.m == at->second.m && grain.r < at->second.r)) at->second = grain;
  }
  double step = std::numeric_limits<double>::infinity();
  const auto take = [&](const ContactParameters& p, const Geometry<double>& g, double inverse_mass,
                        double inverse_inertia, double arm) {
    step = std::min(step, critical_step(p, g, inverse_mass, inverse_inertia, arm));
  };
  for (const auto& [of, a] : lightest) {
    const double turning = 2.5 / (a.m * a.r * a.r);  // 1/I of a sphere
    for (const auto& [other, b] : lightest)
      take(scene.between(of, other), usual_contact(a.r, b.r), 1 / a.m + 1 / b.m,
           turning + 2.5 / (b.m * b.r * b.r), std::max(a.r, b.r));
    for (const BodyId id : planes) {
      const Body& plane = scene.body(id);
      if (!plane.is_there()) continue;
      const double inverse_mass = plane.along(plane.axis).kind == Drive::Kind::stress ? 1 / plane.mass : 0;
      take(scene.between(of, plane.material), usual_contact_at_plane(a.r), 1 / a.m + inverse_mass, turning,
           a.r);
    }
  }
  return step;
}

}  // namespace moraine::dem
