#include "case/import_sphere.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>
#include <numeric>
#include <sstream>
#include <tuple>
#include <utility>
#include <vector>

#include "case/case.hpp"
#include "case/keys.hpp"
#include "error.hpp"
#include "output/files.hpp"

namespace moraine::cases {
namespace {

namespace fs = std::filesystem;
using dem::Vec3d;

static_assert(std::endian::native == std::endian::little, "sphere binaries are read as they lie on disk");

class Binary {
 public:
  explicit Binary(const fs::path& path) : path_(path.string()) {
    std::error_code failed;
    if (fs::is_regular_file(path, failed)) file_.open(path, std::ios::binary);  // a pipe would be waited for
    if (!file_.is_open()) throw error(path_, ": cannot be read; expected a sphere binary");
    left_ = fs::file_size(path);
  }

  template <class T>
  std::vector<T> take(std::uint64_t n) {
    if (n > left_ / sizeof(T))
      throw error(path_, ": truncated; ", n * sizeof(T), " bytes expected where ", left_, " are left");
    std::vector<T> values(n);
    if (!file_.read(reinterpret_cast<char*>(values.data()), n * sizeof(T)))
      throw error(path_, ": cannot be read");
    left_ -= n * sizeof(T);
    return values;
  }
  template <class T>
  T one() {
    return take<T>(1)[0];
  }
  Vec3d vector() { return {one<double>(), one<double>(), one<double>()}; }
  std::vector<Vec3d> vectors(std::uint64_t n) {
    const auto flat = take<double>(3 * n);  // first: a false n must not allocate
    std::vector<Vec3d> v(n);
    for (std::uint64_t i = 0; i < n; ++i) v[i] = {flat[3 * i], flat[3 * i + 1], flat[3 * i + 2]};
    return v;
  }
  std::pair<std::vector<Vec3d>, std::vector<double>> vectors_and_scalars(std::uint64_t n) {
    const auto flat = take<double>(4 * n);
    std::vector<Vec3d> v(n);
    std::vector<double> s(n);
    for (std::uint64_t i = 0; i < n; ++i) {
      v[i] = {flat[4 * i], flat[4 * i + 1], flat[4 * i + 2]};
      s[i] = flat[4 * i + 3];
    }
    return {v, s};
  }

  template <class... Parts>
  void expect(bool right, const Parts&... parts) const {
    if (!right) throw error(path_, ": no sphere binary, or damaged: ", parts...);
  }

 private:
  std::string path_;
  std::ifstream file_;
  std::uint64_t left_;
};

bool finite(const Vec3d& a) { return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z); }

double wrapped(double x, double side) {
  const double inside = x - side * std::floor(x / side);
  return inside < side ? inside : 0;  // rounding may give `side` itself
}

struct Bed {
  double version, time;
  dem::Scene scene;
  dem::State state;
};

Bed read_bed(const fs::path& path) {
  Binary in(path);
  Bed bed;
  bed.version = in.one<double>();
  in.expect(bed.version >= 1.03 - 1e-9 && bed.version <= 2.15 + 1e-9, "version ", bed.version,
            ", expected 1.03 to 2.15");
  const auto dimensions = in.one<std::int32_t>();
  in.expect(dimensions == 3, dimensions, " dimensions, expected 3");
  const auto n = in.one<std::uint32_t>();
  in.expect(n >= 1 && n <= 0x7fffffffu, n, " grains");
  bed.time = in.take<double>(4)[1];  // dt, current, total, between files
  in.one<std::uint32_t>();           // number of the file

  const Vec3d origin = in.vector(), box = in.vector();
  in.expect(finite(origin) && finite(box) && std::min({box.x, box.y, box.z}) > 0, "box ", box.x, " x ", box.y,
            " x ", box.z, " m");
  in.take<std::uint32_t>(3);  // cells
  const auto periodic = in.one<std::int32_t>();
  in.expect(periodic == 1, "boundary type ", periodic, ", expected 1 (x and y periodic)");
  if (bed.version >= 2.14 - 1e-9) in.one<std::int32_t>();  // adaptive grid

  dem::State& s = bed.state;
  std::tie(s.x, s.r) = in.vectors_and_scalars(n);
  in.take<double>(3 * std::uint64_t(n));  // displacement
  s.v = in.vectors_and_scalars(n).first;
  in.vectors(n);  // force
  s.rotation = in.vectors(n);
  s.omega = in.vectors(n);
  in.vectors(n);                          // torque
  in.take<double>(5 * std::uint64_t(n));  // energies and pressure
  for (std::uint32_t i = 0; i < n; ++i) {
    in.expect(s.r[i] > 0 && 2 * s.r[i] < std::min(box.x, box.y), "grain ", i, " has radius ", s.r[i], " m");
    in.expect(finite(s.x[i]) && finite(s.v[i]) && finite(s.omega[i]) && finite(s.rotation[i]), "grain ", i,
              " has a position, velocity or rotation that is no finite number");
    s.x[i] -= origin;
    s.x[i].x = wrapped(s.x[i].x, box.x);
    s.x[i].y = wrapped(s.x[i].y, box.y);
  }

  dem::Scene& scene = bed.scene;
  scene.box = box;
  const Vec3d g = in.vector();
  in.expect(g.x == 0 && g.y == 0 && g.z <= 0, "gravity ", g.x, ", ", g.y, ", ", g.z,
            " m/s2, expected along -z");
  scene.gravity = std::abs(g.z);
  const Vec3d k = in.vector();                       // normal, tangential, rolling
  if (bed.version >= 2.13 - 1e-9) in.one<double>();  // Young's modulus
  const auto p = in.take<double>(11);  // gamma n t r, mu s d r, wall gamma n t, wall mu s d, density
  in.expect(k.x > 0 && k.y >= 0 && p[10] > 0 && finite(k) &&
                std::all_of(p.begin(), p.end(), [](double q) { return q >= 0 && std::isfinite(q); }),
            "k_n = ", k.x, " N/m, k_t = ", k.y, " N/m, density = ", p[10], " kg/m3, or a negative parameter");
  dem::ContactParameters &grain = scene.with(dem::Material::grain), &wall = scene.with(dem::Material::wall);
  grain.k_n = k.x, grain.k_t = k.y, grain.gamma_n = p[0], grain.gamma_t = p[1];
  grain.mu_s = p[3], grain.mu_d = p[4];
  wall.k_n = k.x, wall.k_t = 0, wall.gamma_n = p[6], wall.gamma_t = p[7];
  wall.mu_s = wall.mu_d = p[9];  // viscous below the dynamic limit, no spring
  scene.density.fill(p[10]);

  s.id.resize(n);
  std::iota(s.id.begin(), s.id.end(), 0);
  s.force.assign(n, {0, 0, 0});
  s.torque.assign(n, {0, 0, 0});
  s.x_start = s.x;
  s.part_of.assign(n, dem::BodyId::none);
  for (std::uint32_t i = 0; i < n; ++i) s.wall_z() = std::max(s.wall_z(), s.x[i].z + s.r[i]);
  return bed;
}

std::string case_text(const Bed& bed, const std::string& file) {
  const dem::ContactParameters &grain = bed.scene.with(dem::Material::grain),
                               &wall = bed.scene.with(dem::Material::wall);
  std::ostringstream text;
  const auto line = [&](const char* key, const Value& value) {
    text << key << " = " << to_toml(value) << "\n";
  };
  line("title", "bed taken over from " + file);
  text << "start = \"start.h5\"  # " << bed.state.size() << " grains of that file, at " << bed.time << " s\n";
  text << "\n# Box, density, contacts, walls and gravity are those of the file; the stages are a "
          "suggestion.\n[box]\n";
  line("x", bed.scene.box.x), line("y", bed.scene.box.y), line("z", bed.scene.box.z);
  line("periodic", std::string("xy"));
  text << "\n[grains]\n";
  line("density", bed.scene.density_of(dem::Material::grain));
  text << "\n[contact]\n";
  line("k_n", grain.k_n), line("k_t", grain.k_t);
  line("gamma_n", grain.gamma_n), line("gamma_t", grain.gamma_t);
  line("mu_s", grain.mu_s), line("mu_d", grain.mu_d);
  text << "\n[model]\n";
  line("gravity", bed.scene.gravity);
  text << "\n[[stage]]\nname = \"consolidate\"\nkind = \"consolidate\"\nnormal_stress = \"10 kPa\"\nduration "
          "= \"0.1 s\"\n";
  // Damping beyond the critical one makes explicit steps chatter: the run would be refused.
  const double r_min = *std::min_element(bed.state.r.begin(), bed.state.r.end());
  const double critical =
      2 * std::sqrt(grain.k_n * dem::sphere_mass(bed.scene.density_of(dem::Material::grain), r_min));
  const auto damping = [&](const char* key, double of_file) {
    line(key, std::min(of_file, critical));
    if (of_file > critical)
      text << "# the file has " << of_file << ", above critical damping of its smallest grain\n";
  };
  damping("wall_gamma_n", wall.gamma_n), damping("wall_gamma_t", wall.gamma_t);
  line("wall_mu", wall.mu_d);
  text << "\n[[stage]]\nname = \"shear\"\nkind = \"shear\"\nnormal_stress = \"10 kPa\"\nstrain_rate = \"0.05 "
          "1/s\"\n"
          "strain = 0.02\n";
  return text.str();
}

}  // namespace

void import_sphere(const fs::path& bin, const fs::path& case_dir) {
  if (fs::exists(case_dir / "case.toml"))
    throw error((case_dir / "case.toml").string(),
                ": is there already; choose another directory or remove it");
  const Bed bed = read_bed(bin);
  const std::string text = case_text(bed, bin.filename().string());

  std::error_code fault;
  fs::create_directories(case_dir, fault);
  if (fault) throw error(case_dir.string(), ": cannot be made: ", fault.message());
  output::Checkpoint checkpoint;
  checkpoint.case_text = text;
  checkpoint.finished = true;
  checkpoint.scene = bed.scene;
  checkpoint.state = bed.state;
  output::write_checkpoint(case_dir / "start.h5", checkpoint);
  output::write_text(case_dir / "case.toml", text);
  load(case_dir);  // what the file says may be no case, such as mu_d > mu_s
}

}  // namespace moraine::cases
