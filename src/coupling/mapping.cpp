#include "coupling/mapping.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "dem/scene.hpp"

namespace moraine::coupling {

using dem::Vec3d;

namespace {

using Stencil = Mapping::Stencil;

// Two neighbours on a line of points, the hat weight of the second, and the way from the first in cells.
struct Pair {
  int low, high;
  double t, xi;
};

// Points at whole numbers, 0 to `last`; on a periodic line 0 follows.
Pair between(double s, int last, bool periodic) {
  if (periodic) {
    const int n = last + 1;
    s -= n * std::floor(s / n);
    const int low = std::clamp(static_cast<int>(s), 0, last);
    return {low, low == last ? 0 : low + 1, s - low, s - low};
  }
  // Beyond the ends the last point's weight is one.
  if (last == 0) return {0, 0, 0, s};
  const int low = std::clamp(static_cast<int>(std::floor(s)), 0, last - 1);
  return {low, low + 1, std::clamp(s - low, 0.0, 1.0), s - low};
}

// axis: of the faces, or -1 for cell centres.
Stencil stencil(const fluid::Grid& g, int axis, const Vec3d& x) {
  Pair p[3];
  Index stride = 1, low[3], high[3];
  Stencil out;
  for (int a = 0; a < 3; ++a) {
    const int points = a == axis ? g.faces(a) : g.n[a];
    p[a] = between(x[a] / g.h(a) - (a == axis ? 0.0 : 0.5), points - 1, g.periodic[a]);
    low[a] = stride * p[a].low, high[a] = stride * p[a].high;
    stride *= points;
    out.xi[a][0] = p[a].xi, out.xi[a][1] = p[a].xi - 1;
  }
  for (int e = 0; e < 8; ++e) {
    const bool up[3] = {(e & 1) != 0, (e & 2) != 0, (e & 4) != 0};
    out.point[e] = (up[0] ? high[0] : low[0]) + (up[1] ? high[1] : low[1]) + (up[2] ? high[2] : low[2]);
    out.w[e] = (up[0] ? p[0].t : 1 - p[0].t) * (up[1] ? p[1].t : 1 - p[1].t) * (up[2] ? p[2].t : 1 - p[2].t);
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

  volume_.resize(n), stencils_.resize(n);
  for (Index i = 0; i < n; ++i) volume_[i] = dem::sphere_volume(grains[i].r);
  const auto put_stencils = [&](int axis) {
    for (Index i = 0; i < n; ++i) stencils_[i] = stencil(grid, axis, x[i]);
  };
  put_stencils(-1);
  find_bearing(grid, grains, squeeze);
  for (int axis = 0; axis < 3; ++axis) {
    put_stencils(axis);
    weigh(grid, axis, open_low[axis], open_high[axis]);
    round(axis, top_layer);
    lay_out(axis);
  }
  for (Chunk& c : chunks_) {
    c.first_octet[3] = static_cast<Index>(c.octets.size()),
    c.first_slot[3] = static_cast<Index>(c.face.size());
    c.sum.assign(c.face.size(), {0, 0});
  }
  start_from(x);
}

// Which grains are held or squeezed hardly less than those around them; and the porosity. From cells'
// stencils.
void Mapping::find_bearing(const fluid::Grid& grid, const dem::GrainRow* grains,
                           const std::vector<double>& squeeze) {
  const std::size_t n = stencils_.size();
  std::vector<double> solid(grid.cells(), 0), mean(grid.cells(), 0);  // m3; m
  for (std::size_t i = 0; i < n; ++i)
    for (int e = 0; e < 8; ++e) {
      const double v = volume_[i] * stencils_[i].w[e];
      solid[stencils_[i].point[e]] += v, mean[stencils_[i].point[e]] += v * squeeze[i];
    }
  phi_.resize(grid.cells());
  for (std::size_t c = 0; c < grid.cells(); ++c) {
    phi_[c] = 1 - solid[c] / grid.cell_volume();
    if (solid[c] > 0) mean[c] /= solid[c];
  }
  bears_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    double around = 0;
    for (int e = 0; e < 8; ++e) around += stencils_[i].w[e] * mean[stencils_[i].point[e]];
    const bool held = grains[i].inverse_inertia == 0;
    bears_[i] = held || (squeeze[i] > 0 && squeeze[i] >= loose_below * around);
  }
}

// Makes the hats of the stencils weights b; and psi_ of the axis.
void Mapping::weigh(const fluid::Grid& grid, int axis, bool open_low, bool open_high) {
  std::vector<Stencil>& faces = stencils_;
  const std::size_t count = grid.face_count(axis), n = faces.size();
  std::vector<Moments> moments(count), loose(count);
  for (std::size_t i = 0; i < n; ++i) {
    std::vector<Moments>& kind = bears_[i] ? moments : loose;
    for (int e = 0; e < 8; ++e) kind[faces[i].point[e]].add(volume_[i] * faces[i].w[e], faces[i].from(e));
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
      const double counts = bears_[i] ? 1 : loose_share[f];
      faces[i].w[e] *= scale[f] * counts * volume_[i] * (1 + dot(slope[f], faces[i].from(e)));
    }
}

void Mapping::round(int axis, const std::vector<bool>& top_layer) {
  const std::vector<Stencil>& faces = stencils_;
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
      b = largest[f] > 0 ? static_cast<std::int16_t>(std::lrint(most * faces[i].w[e] / largest[f])) : 0;
      rounded[f] += b;
      if (top_layer[i]) layer_[axis][f] += b;
    }
  scale_[axis].assign(count, 0);
  for (std::size_t f = 0; f < count; ++f)
    if (rounded[f] != 0) scale_[axis][f] = exact[f] / rounded[f];
}

void Mapping::lay_out(int axis) {
  constexpr Index none = -1;
  std::vector<Index> slot_of(psi_[axis].size(), none), octet_of = slot_of;  // by its first face
  for (Chunk& c : chunks_) {
    c.first_octet[axis] = static_cast<Index>(c.octets.size());
    c.first_slot[axis] = static_cast<Index>(c.face.size());
    for (Index i = c.begin; i < c.end; ++i) {
      const auto& point = stencils_[i].point;
      Index& octet = octet_of[point[0]];
      if (octet == none) {
        octet = static_cast<Index>(c.octets.size());
        Octet& o = c.octets.emplace_back();
        o.face = point;
        for (int e = 0; e < 8; e += 2) {
          Index& slot = slot_of[point[e]];
          if (slot == none) {
            slot = static_cast<Index>(c.face.size());
            c.face.push_back({point[e], point[e + 1]});
          }
          o.slot[e / 2] = slot;
        }
      }
      weights_[i].octet[axis] = static_cast<std::uint16_t>(octet);
    }
    for (auto o = static_cast<std::size_t>(c.first_octet[axis]); o < c.octets.size(); ++o)
      octet_of[c.octets[o].face[0]] = none;
    for (auto s = static_cast<std::size_t>(c.first_slot[axis]); s < c.face.size(); ++s)
      slot_of[c.face[s][0]] = none;
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
    most = max(abs(d), most);
    const Weights& w = weights_[i];
    for (int axis = 0; axis < 3; ++axis) {
      std::array<Pack, 2>& to = octet[w.octet[axis]];
      const Pack along(d[axis]);
      to[0] = fma(w.of(axis, 0), along, to[0]), to[1] = fma(w.of(axis, 1), along, to[1]);
    }
  }
  std::fill(c.sum.begin(), c.sum.end(), Two{0, 0});
  for (std::size_t o = 0; o < c.octets.size(); ++o)
    for (int e = 0; e < 8; e += 2) {
      Two& to = c.sum[c.octets[o].slot[e / 2]];
      to = {to[0] + octet[o][e / 4][e % 4], to[1] + octet[o][e / 4][e % 4 + 1]};
    }
  for (Two& sum : c.sum) sum = {unit * sum[0], unit * sum[1]};
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
      for (Index s = c.first_slot[axis]; s < c.first_slot[axis + 1]; ++s)
        for (int e = 0; e < 2; ++e) to[c.face[s][e]] += c.sum[s][e];
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
    Pack f[3];
    for (int axis = 0; axis < 3; ++axis) {
      const std::array<Pack, 2>& at = octet[w.octet[axis]];
      f[axis] = fma(w.of(axis, 0), at[0], w.of(axis, 1) * at[1]);
    }
    sums_of(f[0], f[1], f[2]).store(&force[i].f.x);
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
