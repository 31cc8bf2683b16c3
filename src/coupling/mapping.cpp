#include "coupling/mapping.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "dem/scene.hpp"

namespace moraine::coupling {

namespace {

using dem::Vec3d;

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

struct Stencil {
  std::array<Index, 8> point;
  std::array<double, 8> w;
  std::array<Vec3d, 8> xi;  // from the point, in cells
};

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
                    const std::vector<Vec3d>& x, const std::vector<bool>& top_layer) {
  n_ = static_cast<Index>(x.size());
  const Index size = dem::chunk_size(n_);
  chunks_.assign(static_cast<std::size_t>(dem::chunk_count(n_)), {});

  std::vector<double> solid(grid.cells(), 0);
  for (Index i = 0; i < n_; ++i) {
    const Stencil s = stencil(grid, -1, x[i]);
    for (int k = 0; k < 8; ++k) solid[s.point[k]] += dem::sphere_volume(grains[i].r) * s.w[k];
  }
  phi_.resize(grid.cells());
  for (std::size_t c = 0; c < phi_.size(); ++c) phi_[c] = 1 - solid[c] / grid.cell_volume();

  std::vector<Stencil> stencils(n_);
  std::vector<double> exact, rounded;  // sums of b over each face
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t faces = grid.face_count(axis);
    std::vector<Moments> moments(faces);
    for (Index i = 0; i < n_; ++i) {
      stencils[i] = stencil(grid, axis, x[i]);
      const double v = dem::sphere_volume(grains[i].r);
      for (int k = 0; k < 8; ++k) moments[stencils[i].point[k]].add(v * stencils[i].w[k], stencils[i].xi[k]);
    }
    std::vector<Vec3d> slope(faces, {0, 0, 0});
    std::vector<double> scale(faces, 0);  // A/W; 0 at closed sides
    psi_[axis].assign(faces, 0), layer_[axis].assign(faces, 0);
    exact.assign(faces, 0), rounded.assign(faces, 0);
    const double area = grid.face_area(axis), volume = grid.cell_volume();
    for (int k = 0; k < (axis == 2 ? grid.faces(2) : grid.n[2]); ++k)
      for (int j = 0; j < (axis == 1 ? grid.faces(1) : grid.n[1]); ++j)
        for (int i = 0; i < (axis == 0 ? grid.faces(0) : grid.n[0]); ++i) {
          const std::size_t f = grid.face(axis, i, j, k);
          const int at = axis == 0 ? i : axis == 1 ? j : k;
          const bool side = !grid.periodic[axis] && (at == 0 || at == grid.n[axis]);
          const Moments& m = moments[f];
          const double hat = (side ? 0.5 : 1.0) * volume;
          psi_[axis][f] = m.m0 / hat;
          if (side && !(at == 0 ? open_low : open_high)[axis]) continue;
          slope[f] = affine_correction(m, psi_[axis][f], side ? axis : -1);
          const double w = std::max(m.m0 + dot(slope[f], m.m1), psi_min * hat);
          scale[f] = area / w, psi_[axis][f] = w / hat;
        }

    for (Index c = 0; c < chunks(); ++c) {
      Axis& a = chunks_[c].axis[axis];
      const Index begin = c * size, end = std::min(n_, begin + size);
      std::vector<Index> order(end - begin);
      std::iota(order.begin(), order.end(), begin);
      const auto first_face = [&](Index i) { return stencils[i].point; };
      std::stable_sort(order.begin(), order.end(),
                       [&](Index p, Index q) { return first_face(p) < first_face(q); });
      std::map<Index, Index> slot_of;
      for (std::size_t k = 0; k < order.size();) {
        Bin bin;
        bin.face = first_face(order[k]);
        for (int e = 0; e < 8; ++e) {
          const auto [found, fresh] = slot_of.try_emplace(bin.face[e], static_cast<Index>(a.face.size()));
          if (fresh) a.face.push_back(bin.face[e]);
          bin.slot[e] = found->second;
        }
        bin.first = static_cast<Index>(a.packs.size());
        int lane = 0;
        for (; k < order.size() && first_face(order[k]) == bin.face; ++k, ++lane) {
          const Index i = order[k];
          if (lane % 4 == 0) {
            Lane4& fresh = a.packs.emplace_back();
            fresh.b.fill({0, 0, 0, 0}), fresh.grain.fill(i);
          }
          Lane4& pack = a.packs.back();
          pack.grain[lane % 4] = i;
          for (int e = 0; e < 8; ++e) {
            const Index f = bin.face[e];
            const double b = scale[f] * dem::sphere_volume(grains[i].r) * stencils[i].w[e] *
                             (1 + dot(slope[f], stencils[i].xi[e]));
            pack.b[e][lane % 4] = static_cast<float>(b);
            exact[f] += b, rounded[f] += pack.b[e][lane % 4];
            if (top_layer[i]) layer_[axis][f] += pack.b[e][lane % 4];
          }
        }
        bin.packs = static_cast<Index>(a.packs.size()) - bin.first;
        bin.in_last = (lane - 1) % 4 + 1;
        a.bins.push_back(bin);
      }
      a.sum.assign(a.face.size(), 0);
    }
    scale_[axis].assign(faces, 0);
    for (std::size_t f = 0; f < faces; ++f)
      if (rounded[f] != 0) scale_[axis][f] = exact[f] / rounded[f];
  }
  start_from(x);
}

void Mapping::start_from(const std::vector<Vec3d>& x) {
  for (Chunk& chunk : chunks_)
    for (int axis = 0; axis < 3; ++axis) {
      Axis& a = chunk.axis[axis];
      a.last.resize(a.packs.size());
      for (std::size_t p = 0; p < a.packs.size(); ++p)
        for (int k = 0; k < 4; ++k) a.last[p].v[k] = x[a.packs[p].grain[k]][axis];
    }
}

std::vector<Vec3d> Mapping::last() const {
  std::vector<Vec3d> x(n_);
  for (const Chunk& chunk : chunks_)
    for (int axis = 0; axis < 3; ++axis) {
      const Axis& a = chunk.axis[axis];
      for (std::size_t p = 0; p < a.packs.size(); ++p)
        for (int k = 0; k < 4; ++k) x[a.packs[p].grain[k]][axis] = a.last[p][k];
    }
  return x;
}

Pack Mapping::Lane4::weight(int e) const {
#if defined(__AVX__)
  return _mm256_cvtps_pd(_mm_loadu_ps(b[e].data()));
#else
  return {b[e][0], b[e][1], b[e][2], b[e][3]};
#endif
}

// displacement(axis, list of the axis, number of the pack): Pack, m.
template <class Displacement>
void Mapping::add_up(Index c, Displacement&& displacement) {
  Chunk& chunk = chunks_[c];
  Pack most(0.0);
  for (int axis = 0; axis < 3; ++axis) {
    Axis& a = chunk.axis[axis];
    std::fill(a.sum.begin(), a.sum.end(), 0.0);
    for (const Bin& bin : a.bins) {
      std::array<Pack, 8> sum;
      sum.fill(Pack(0.0));
      for (Index p = bin.first; p < bin.first + bin.packs; ++p) {
        const Pack d = displacement(axis, a, p);
        most = max(max(d, -d), most);
        for (int e = 0; e < 8; ++e) sum[e] = fma(a.packs[p].weight(e), d, sum[e]);
      }
      for (int e = 0; e < 8; e += 4) {
        transpose(sum[e], sum[e + 1], sum[e + 2], sum[e + 3]);
        const Pack total = (sum[e] + sum[e + 1]) + (sum[e + 2] + sum[e + 3]);
        for (int k = 0; k < 4; ++k) a.sum[bin.slot[e + k]] += total[k];
      }
    }
  }
  chunk.moved = std::max({most[0], most[1], most[2], most[3]});
}

void Mapping::displace(Index c, const dem::GrainRow* grains) {
  add_up(c, [grains](int axis, Axis& a, Index p) {
    const std::array<Index, 4>& i = a.packs[p].grain;
    const Pack x(grains[i[0]].x[axis], grains[i[1]].x[axis], grains[i[2]].x[axis], grains[i[3]].x[axis]);
    const Pack d = x - a.last[p];
    a.last[p] = x;
    return d;
  });
}

void Mapping::displace(Index c, const dem::GrainRow* grains, double dt) {
  add_up(c, [grains, dt](int axis, const Axis& a, Index p) {
    const std::array<Index, 4>& i = a.packs[p].grain;
    return Pack(dt) *
           Pack(grains[i[0]].v[axis], grains[i[1]].v[axis], grains[i[2]].v[axis], grains[i[3]].v[axis]);
  });
}

double Mapping::collect(Faces& u) const {
  double moved = 0;
  for (auto& axis : u) std::fill(axis.begin(), axis.end(), 0.0);
  for (const Chunk& chunk : chunks_) {
    for (int axis = 0; axis < 3; ++axis) {
      const Axis& a = chunk.axis[axis];
      double* const to = u[axis].data();
      for (std::size_t s = 0; s < a.face.size(); ++s) to[a.face[s]] += a.sum[s];
    }
    moved = std::max(moved, chunk.moved);
  }
  for (int axis = 0; axis < 3; ++axis)
    for (std::size_t f = 0; f < u[axis].size(); ++f) u[axis][f] *= scale_[axis][f];
  return moved;
}

void Mapping::push(Index c, const Faces& g, dem::WaterRow* force) const {
  const Chunk& chunk = chunks_[c];
  for (int axis = 0; axis < 3; ++axis) {
    const Axis& a = chunk.axis[axis];
    const double* const of = g[axis].data();
    for (const Bin& bin : a.bins) {
      std::array<Pack, 8> at;
      for (int e = 0; e < 8; ++e) at[e] = Pack(of[bin.face[e]]);
      for (Index p = bin.first; p < bin.first + bin.packs; ++p) {
        const Lane4& pack = a.packs[p];
        Pack f = pack.weight(0) * at[0], rest = pack.weight(1) * at[1];
        for (int e = 2; e < 8; e += 2)
          f = fma(pack.weight(e), at[e], f), rest = fma(pack.weight(e + 1), at[e + 1], rest);
        f += rest;
        const int lanes = p + 1 < bin.first + bin.packs ? 4 : bin.in_last;
        for (int k = 0; k < lanes; ++k) force[pack.grain[k]].f[axis] = f[k];
      }
    }
  }
}

void Mapping::apply(const std::vector<Vec3d>& d, Faces& u) const {
  for (auto& axis : u) std::fill(axis.begin(), axis.end(), 0.0);
  for (const Chunk& chunk : chunks_)
    for (int axis = 0; axis < 3; ++axis)
      for (const Bin& bin : chunk.axis[axis].bins)
        for (Index p = bin.first; p < bin.first + bin.packs; ++p) {
          const Lane4& pack = chunk.axis[axis].packs[p];
          for (int k = 0; k < 4; ++k)  // lanes that hold no grain have no weight
            for (int e = 0; e < 8; ++e)
              u[axis][bin.face[e]] += scale_[axis][bin.face[e]] * (pack.b[e][k] * d[pack.grain[k]][axis]);
        }
}

}  // namespace moraine::coupling
