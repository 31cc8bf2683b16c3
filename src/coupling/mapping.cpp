#include "coupling/mapping.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include "dem/scene.hpp"

namespace moraine::coupling {

using dem::Vec3d;

// The eight points around a grain.
struct Mapping::Stencil {
  std::array<Index, 8> point;
  std::array<double, 8> w;  // hats, later weights b in m2
  std::array<Vec3d, 8> xi;  // from the point, in cells
};

namespace {

using Stencil = Mapping::Stencil;

// Two neighbours on a line of points, and the hat weight of the second.
struct Pair {
  int low, high;
  double t;
};

double wrapped(double s, int n) { return s - n * std::floor(s / n); }

// Points at whole numbers: the faces along their own axis.
Pair between_faces(double s, int n, bool periodic) {
  if (periodic) {
    s = wrapped(s, n);
    const int low = std::min(static_cast<int>(s), n - 1);
    return {low, low + 1 == n ? 0 : low + 1, s - low};
  }
  const int low = std::clamp(static_cast<int>(std::floor(s)), 0, n - 1);
  return {low, low + 1, std::clamp(s - low, 0.0, 1.0)};
}
// Points half way between: centres of cells. Beyond the last of them its weight is one.
Pair between_cells(double s, int n, bool periodic) {
  s -= 0.5;
  if (periodic) {
    s = wrapped(s, n);
    const int low = std::min(static_cast<int>(s), n - 1);
    return {low, low + 1 == n ? 0 : low + 1, s - low};
  }
  if (s <= 0) return {0, 0, 0};
  if (s >= n - 1) return {n - 1, n - 1, 0};
  const int low = static_cast<int>(s);
  return {low, low + 1, s - low};
}

// axis: of the faces, or -1 for cell centres.
Stencil stencil(const fluid::Grid& g, int axis, const Vec3d& x) {
  Pair p[3];
  double xi[3][2];
  for (int a = 0; a < 3; ++a) {
    const double s = x[a] / g.h(a);
    p[a] = a == axis ? between_faces(s, g.n[a], g.periodic[a]) : between_cells(s, g.n[a], g.periodic[a]);
    // From the nearest image of each point.
    for (int side = 0; side < 2; ++side) {
      double d = s - ((side ? p[a].high : p[a].low) + (a == axis ? 0.0 : 0.5));
      if (g.periodic[a]) d -= g.n[a] * std::round(d / g.n[a]);
      xi[a][side] = d;
    }
    // On one or two cells the image is not unique: tell by the weight.
    if (g.periodic[a] && g.n[a] <= 2) xi[a][0] = p[a].t, xi[a][1] = p[a].t - 1;
  }
  Stencil out;
  for (int k = 0; k < 8; ++k) {
    const int side[3] = {k & 1, (k >> 1) & 1, k >> 2};
    int at[3];
    double w = 1;
    for (int a = 0; a < 3; ++a) {
      at[a] = side[a] ? p[a].high : p[a].low;
      w *= side[a] ? p[a].t : 1 - p[a].t;
      out.xi[k][a] = xi[a][side[a]];
    }
    out.w[k] = w;
    out.point[k] =
        static_cast<Index>(axis < 0 ? g.cell(at[0], at[1], at[2]) : g.face(axis, at[0], at[1], at[2]));
  }
  return out;
}

// Moments of solid volume about a point, xi in cells.
struct Moments {
  double m0 = 0;
  Vec3d m1{0, 0, 0};
  double m2[6] = {0, 0, 0, 0, 0, 0};  // xx, yy, zz, xy, xz, yz

  void add(double v, const Vec3d& xi) {
    m0 += v;
    m1 += v * xi;
    m2[0] += v * xi.x * xi.x, m2[1] += v * xi.y * xi.y, m2[2] += v * xi.z * xi.z;
    m2[3] += v * xi.x * xi.y, m2[4] += v * xi.x * xi.z, m2[5] += v * xi.y * xi.z;
  }
  void add(double share, const Moments& m) {
    m0 += share * m.m0, m1 += share * m.m1;
    for (int k = 0; k < 6; ++k) m2[k] += share * m.m2[k];
  }
};

// a with M2 a = -M1, without the component `skip` (-1: none), shortened where grains are few.
Vec3d affine_correction(const Moments& m, double psi, int skip) {
  const double fade = std::clamp((psi - Mapping::psi_min) / 0.1, 0.0, 1.0);
  if (fade == 0) return {0, 0, 0};
  double a[3][4] = {{m.m2[0], m.m2[3], m.m2[4], -m.m1.x},
                    {m.m2[3], m.m2[1], m.m2[5], -m.m1.y},
                    {m.m2[4], m.m2[5], m.m2[2], -m.m1.z}};
  for (int r = 0; r < 3; ++r) a[r][r] += 1e-3 * m.m0;  // of the 1/6 m0 of evenly spread grains
  if (skip >= 0) {
    for (int k = 0; k < 4; ++k) a[skip][k] = 0;
    for (auto& row : a) row[skip] = 0;
    a[skip][skip] = 1;
  }
  // Symmetric and positive: elimination needs no pivots.
  for (int c = 0; c < 3; ++c)
    for (int r = c + 1; r < 3; ++r) {
      const double f = a[r][c] / a[c][c];
      for (int k = c; k < 4; ++k) a[r][k] -= f * a[c][k];
    }
  Vec3d x;
  x.z = a[2][3] / a[2][2];
  x.y = (a[1][3] - a[1][2] * x.z) / a[1][1];
  x.x = (a[0][3] - a[0][1] * x.y - a[0][2] * x.z) / a[0][0];
  // Weights stay positive over most of the hat.
  const double steepest = std::max({std::abs(x.x), std::abs(x.y), std::abs(x.z)});
  return (fade * (steepest > 2 ? 2 / steepest : 1)) * x;
}

std::vector<Stencil> stencils_of(const fluid::Grid& grid, int axis, const std::vector<Vec3d>& x) {
  std::vector<Stencil> out(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) out[i] = stencil(grid, axis, x[i]);
  return out;
}

// Grains that are squeezed hardly less than those around them, and held ones.
std::vector<bool> bearing(const fluid::Grid& grid, const std::vector<Stencil>& cells,
                          const dem::GrainRow* grains, const std::vector<double>& squeeze) {
  std::vector<double> solid(grid.cells(), 0), squeezed(grid.cells(), 0);  // m3, m4
  for (std::size_t i = 0; i < cells.size(); ++i)
    for (int k = 0; k < 8; ++k) {
      const double v = dem::sphere_volume(grains[i].r) * cells[i].w[k];
      solid[cells[i].point[k]] += v, squeezed[cells[i].point[k]] += v * squeeze[i];
    }
  std::vector<bool> bears(cells.size());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    double around = 0;
    for (int k = 0; k < 8; ++k) {
      const Index c = cells[i].point[k];
      if (solid[c] > 0) around += cells[i].w[k] * squeezed[c] / solid[c];
    }
    const bool held = grains[i].inverse_inertia == 0;
    bears[i] = held || (squeeze[i] > 0 && squeeze[i] >= Mapping::loose_below * around);
  }
  return bears;
}

}  // namespace

void Mapping::build(const fluid::Grid& grid, const std::array<bool, 3>& open_low,
                    const std::array<bool, 3>& open_high, const dem::GrainRow* grains,
                    const std::vector<Vec3d>& x, const std::vector<double>& squeeze,
                    const std::vector<bool>& top_layer) {
  const auto n = static_cast<Index>(x.size());
  const Index size = dem::chunk_size(n);
  chunks_.assign(static_cast<std::size_t>(dem::chunk_count(n)), {});
  for (Index c = 0; c < chunks(); ++c)
    chunks_[c].begin = c * size, chunks_[c].end = std::min(n, (c + 1) * size);
  weights_.resize(n);

  const std::vector<Stencil> cells = stencils_of(grid, -1, x);
  phi_.assign(grid.cells(), 1);
  for (Index i = 0; i < n; ++i)
    for (int k = 0; k < 8; ++k)
      phi_[cells[i].point[k]] -= dem::sphere_volume(grains[i].r) * cells[i].w[k] / grid.cell_volume();
  const std::vector<bool> bears = bearing(grid, cells, grains, squeeze);

  for (int axis = 0; axis < 3; ++axis) {
    std::vector<Stencil> faces = stencils_of(grid, axis, x);
    weigh(grid, axis, open_low[axis], open_high[axis], grains, bears, faces);
    round(axis, faces, top_layer);
    lay_out(axis, faces);
  }
  for (Chunk& c : chunks_) {
    c.first_octet[3] = static_cast<Index>(c.octets.size()),
    c.first_slot[3] = static_cast<Index>(c.face.size());
    c.sum.assign(c.face.size(), 0);
  }
  start_from(x);
}

// Makes the hats of `faces` weights b; and psi_ of the axis.
void Mapping::weigh(const fluid::Grid& grid, int axis, bool open_low, bool open_high,
                    const dem::GrainRow* grains, const std::vector<bool>& bears,
                    std::vector<Stencil>& faces) {
  const std::size_t count = grid.face_count(axis), n = faces.size();
  std::vector<Moments> moments(count), loose(count);
  for (std::size_t i = 0; i < n; ++i) {
    const double v = dem::sphere_volume(grains[i].r);
    std::vector<Moments>& kind = bears[i] ? moments : loose;
    for (int k = 0; k < 8; ++k) kind[faces[i].point[k]].add(v * faces[i].w[k], faces[i].xi[k]);
  }
  std::vector<Vec3d> slope(count, {0, 0, 0});
  std::vector<double> scale(count, 0);        // A/W; 0 at closed sides
  std::vector<double> loose_share(count, 0);  // of a loose grain's volume that counts
  psi_[axis].assign(count, 0);
  const double area = grid.face_area(axis), volume = grid.cell_volume();
  for (int k = 0; k < (axis == 2 ? grid.faces(2) : grid.n[2]); ++k)
    for (int j = 0; j < (axis == 1 ? grid.faces(1) : grid.n[1]); ++j)
      for (int i = 0; i < (axis == 0 ? grid.faces(0) : grid.n[0]); ++i) {
        const std::size_t f = grid.face(axis, i, j, k);
        const int at = axis == 0 ? i : axis == 1 ? j : k;
        const bool side = !grid.periodic[axis] && (at == 0 || at == grid.n[axis]);
        Moments& m = moments[f];
        const double hat = (side ? 0.5 : 1.0) * volume, solids = m.m0 + loose[f].m0;
        psi_[axis][f] = solids / hat;
        if (solids == 0) continue;
        loose_share[f] = std::clamp(3 - 5 * m.m0 / solids, 0.0, 1.0);
        m.add(loose_share[f], loose[f]);
        if (side && !(at == 0 ? open_low : open_high)) continue;
        slope[f] = affine_correction(m, m.m0 / hat, side ? axis : -1);
        const double few = std::max(1.0, psi_min * hat / solids);
        scale[f] = area / (few * (m.m0 + dot(slope[f], m.m1))), psi_[axis][f] *= few;
      }
  for (std::size_t i = 0; i < n; ++i)
    for (int e = 0; e < 8; ++e) {
      const Index f = faces[i].point[e];
      const double counts = bears[i] ? 1 : loose_share[f];
      faces[i].w[e] *=
          scale[f] * counts * dem::sphere_volume(grains[i].r) * (1 + dot(slope[f], faces[i].xi[e]));
    }
}

void Mapping::round(int axis, const std::vector<Stencil>& faces, const std::vector<bool>& top_layer) {
  constexpr double most = 32767;
  const std::size_t count = psi_[axis].size();
  std::vector<double> largest(count, 0), exact(count, 0), rounded(count, 0);  // the last two: sums
  for (const Stencil& s : faces)
    for (int e = 0; e < 8; ++e) {
      largest[s.point[e]] = std::max(largest[s.point[e]], std::abs(s.w[e]));
      exact[s.point[e]] += s.w[e];
    }
  layer_[axis].assign(count, 0);
  for (std::size_t i = 0; i < faces.size(); ++i)
    for (int e = 0; e < 8; ++e) {
      const Index f = faces[i].point[e];
      std::int16_t& b = weights_[i].b[axis][e];
      b = largest[f] > 0 ? static_cast<std::int16_t>(std::lround(most * faces[i].w[e] / largest[f])) : 0;
      rounded[f] += b;
      if (top_layer[i]) layer_[axis][f] += b;
    }
  scale_[axis].assign(count, 0);
  for (std::size_t f = 0; f < count; ++f)
    if (rounded[f] != 0) scale_[axis][f] = exact[f] / rounded[f];
}

void Mapping::lay_out(int axis, const std::vector<Stencil>& faces) {
  std::vector<Index> slot_of(psi_[axis].size(), -1);
  for (Chunk& c : chunks_) {
    c.first_octet[axis] = static_cast<Index>(c.octets.size());
    c.first_slot[axis] = static_cast<Index>(c.face.size());
    std::map<std::array<Index, 2>, std::uint16_t> octet_of;  // by the first face and the last
    for (Index i = c.begin; i < c.end; ++i) {
      const auto& point = faces[i].point;
      const auto [found, fresh] =
          octet_of.try_emplace({point[0], point[7]}, static_cast<std::uint16_t>(c.octets.size()));
      weights_[i].octet[axis] = found->second;
      if (!fresh) continue;
      Octet& o = c.octets.emplace_back();
      o.face = point;
      for (int e = 0; e < 8; ++e) {
        Index& slot = slot_of[point[e]];
        if (slot < 0) slot = static_cast<Index>(c.face.size()), c.face.push_back(point[e]);
        o.slot[e] = slot;
      }
    }
    for (auto s = static_cast<std::size_t>(c.first_slot[axis]); s < c.face.size(); ++s)
      slot_of[c.face[s]] = -1;
  }
}

void Mapping::start_from(const std::vector<Vec3d>& x) {
  last_.resize(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) last_[i] = Pack(x[i].x, x[i].y, x[i].z, 0);
}

void Mapping::start_from(Index c, const dem::GrainRow* grains) {
  for (Index i = chunks_[c].begin; i < chunks_[c].end; ++i) last_[i] = Pack::load(&grains[i].x.x);
}

std::vector<Vec3d> Mapping::last() const {
  std::vector<Vec3d> x(last_.size());
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = {last_[i][0], last_[i][1], last_[i][2]};
  return x;
}

// Four of a grain's weights.
Pack Mapping::Weights::of(int axis, int half) const {
  const std::int16_t* const w = b[axis].data() + 4 * half;
#if defined(__AVX__)
  std::int64_t bits;
  std::memcpy(&bits, w, sizeof bits);
  return _mm256_cvtepi32_pd(_mm_cvtepi16_epi32(_mm_cvtsi64_si128(bits)));
#else
  return Pack(w[0], w[1], w[2], w[3]);
#endif
}

// displacement(grain): Pack with x, y, z in its first three lanes, in units of `unit`, m.
template <class Displacement>
void Mapping::add_up(Index chunk, double unit, Displacement&& displacement) {
  Chunk& c = chunks_[chunk];
  static thread_local std::vector<std::array<Pack, 2>> room;
  room.assign(c.octets.size(), {Pack(0.0), Pack(0.0)});
  std::array<Pack, 2>* const octet = room.data();
  Pack most(0.0);
  for (Index i = c.begin; i < c.end; ++i) {
    const Pack d = displacement(i);
    most = max(max(d, -d), most);
    const Weights& w = weights_[i];
    for (int axis = 0; axis < 3; ++axis) {
      std::array<Pack, 2>& to = octet[w.octet[axis]];
      const Pack along(d[axis]);
      to[0] = fma(w.of(axis, 0), along, to[0]), to[1] = fma(w.of(axis, 1), along, to[1]);
    }
  }
  std::fill(c.sum.begin(), c.sum.end(), 0.0);
  for (std::size_t o = 0; o < c.octets.size(); ++o)
    for (int e = 0; e < 8; ++e) c.sum[c.octets[o].slot[e]] += octet[o][e / 4][e % 4];
  for (double& sum : c.sum) sum *= unit;
  c.moved = unit * std::max({most[0], most[1], most[2]});
}

void Mapping::displace(Index c, const dem::GrainRow* grains) {
  add_up(c, 1, [&](Index i) { return Pack::load(&grains[i].x.x) - last_[i]; });
}

void Mapping::displace(Index c, const dem::GrainRow* grains, double dt) {
  add_up(c, dt, [grains](Index i) { return Pack::load(&grains[i].v.x); });
}

double Mapping::collect(Faces& u) const {
  double moved = 0;
  for (auto& axis : u) std::fill(axis.begin(), axis.end(), 0.0);
  for (const Chunk& c : chunks_) {
    for (int axis = 0; axis < 3; ++axis) {
      double* const to = u[axis].data();
      for (Index s = c.first_slot[axis]; s < c.first_slot[axis + 1]; ++s) to[c.face[s]] += c.sum[s];
    }
    moved = std::max(moved, c.moved);
  }
  for (int axis = 0; axis < 3; ++axis)
    for (std::size_t f = 0; f < u[axis].size(); ++f) u[axis][f] *= scale_[axis][f];
  return moved;
}

void Mapping::push(Index chunk, const Faces& g, dem::WaterRow* force) const {
  const Chunk& c = chunks_[chunk];
  static thread_local std::vector<std::array<Pack, 2>> room;
  room.resize(c.octets.size());
  std::array<Pack, 2>* const octet = room.data();
  for (int axis = 0; axis < 3; ++axis) {
    const double* const of = g[axis].data();
    for (Index o = c.first_octet[axis]; o < c.first_octet[axis + 1]; ++o) {
      const std::array<Index, 8>& f = c.octets[o].face;
      octet[o] = {Pack(of[f[0]], of[f[1]], of[f[2]], of[f[3]]), Pack(of[f[4]], of[f[5]], of[f[6]], of[f[7]])};
    }
  }
  for (Index i = c.begin; i < c.end; ++i) {
    const Weights& w = weights_[i];
    Pack f[4];
    for (int axis = 0; axis < 3; ++axis) {
      const std::array<Pack, 2>& at = octet[w.octet[axis]];
      f[axis] = fma(w.of(axis, 0), at[0], w.of(axis, 1) * at[1]);
    }
    f[3] = Pack(0.0);
    transpose(f[0], f[1], f[2], f[3]);
    ((f[0] + f[1]) + (f[2] + f[3])).store(&force[i].f.x);
  }
}

void Mapping::apply(const std::vector<Vec3d>& d, Faces& u) const {
  for (auto& axis : u) std::fill(axis.begin(), axis.end(), 0.0);
  for (const Chunk& c : chunks_)
    for (Index i = c.begin; i < c.end; ++i)
      for (int axis = 0; axis < 3; ++axis)
        for (int e = 0; e < 8; ++e) {
          const Index f = c.octets[weights_[i].octet[axis]].face[e];
          u[axis][f] += scale_[axis][f] * (weights_[i].b[axis][e] * d[i][axis]);
        }
}

}  // namespace moraine::coupling
