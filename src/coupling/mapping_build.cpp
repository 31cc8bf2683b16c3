// How the weights are made.
#include <algorithm>
#include <cmath>

#include "coupling/mapping.hpp"
#include "dem/scene.hpp"
#include "dem/sums.hpp"

namespace moraine::coupling {

using dem::Vec3d;

void Mapping::build(const fluid::Grid& grid, const SidesOf& sides, const dem::GrainRow* grains,
                    const std::vector<Vec3d>& x, const std::vector<double>& squeeze,
                    const std::vector<double>& top_layer) {
  const auto n = static_cast<Index>(x.size());
  const Index size = dem::chunk_size(n);
  chunks_.assign(static_cast<std::size_t>(dem::chunk_count(n)), {});
  for (Index c = 0; c < chunks(); ++c)
    chunks_[c].begin = c * size, chunks_[c].end = std::min(n, (c + 1) * size);
  weights_.resize(n);

  cut(grid, sides.holds, grains, x);
  put_hats(grid, -1, x);
  find_bearing(grid, grains, squeeze);
  for (int axis = 0; axis < 3; ++axis) {
    put_hats(grid, axis, x);
    weigh(grid, axis, sides.open_low[axis], sides.open_high[axis]);
    round(axis, top_layer);
    lay_out(axis), lay_out_wide(axis);
  }
  for (Chunk& c : chunks_) {
    c.first_octet[3] = static_cast<Index>(c.octets.size()),
    c.first_slot[3] = static_cast<Index>(c.face.size());
    c.first_wide_face[3] = static_cast<Index>(c.wide_face.size());
    c.sum.assign(c.face.size(), {0, 0}), c.wide_sum.assign(c.wide_face.size(), 0);
  }
  start_from(x);
}

// What of each grain is where: porosity, wide grains' parts, and what lies outside.
void Mapping::cut(const fluid::Grid& grid, const Holds& holds, const dem::GrainRow* grains,
                  const std::vector<Vec3d>& x) {
  const auto n = static_cast<Index>(x.size());
  fluid::Grid eighths = grid;
  for (int& cells : eighths.n) cells *= 2;
  const double widest = wide_from * std::min({grid.h(0), grid.h(1), grid.h(2)});
  std::vector<double> solid(grid.cells(), 0), over_r(grid.cells(), 0);  // m3; m2, volumes over radii
  const auto cell = [&](int i, int j, int k) {
    std::array<int, 3> c{i, j, k};
    for (int a = 0; a < 3; ++a) c[a] = (c[a] % grid.n[a] + grid.n[a]) % grid.n[a];
    return grid.cell(c[0], c[1], c[2]);
  };
  volume_.resize(n), wide_.clear(), parts_.clear(), outside_ = {};
  for (Index i = 0; i < n; ++i) {
    const double r = grains[i].r;
    const double inside = clip(grid, holds, x[i], r);
    if (r <= widest) {
      volume_[i] = inside;
      ball_.cut(grid, holds, x[i], r);
      ball_.each([&](int a, int b, int c, double v) {
        const std::size_t at = cell(a, b, c);
        solid[at] += v, over_r[at] += v / r;
      });
      continue;
    }
    volume_[i] = 0;
    const std::size_t first = parts_.size();
    ball_.cut(eighths, holds, x[i], r);
    ball_.each([&](int a, int b, int c, double v) {
      const std::size_t at = cell(a >> 1, b >> 1, c >> 1);
      solid[at] += v, over_r[at] += v / r;
      parts_.push_back({{(a + 0.5) * eighths.h(0), (b + 0.5) * eighths.h(1), (c + 0.5) * eighths.h(2)}, v});
    });
    if (parts_.size() > first) wide_.push_back({i, first, parts_.size()});
  }
  phi_.resize(grid.cells()), sauter_.resize(grid.cells());
  for (std::size_t c = 0; c < grid.cells(); ++c) {
    phi_[c] = 1 - solid[c] / grid.cell_volume();
    sauter_[c] = over_r[c] > 0 ? 2 * solid[c] / over_r[c] : 0;
  }
}

// m3, of a grain inside. What is not is booked with the side that it lies beyond, along x first.
double Mapping::clip(const fluid::Grid& grid, const Holds& holds, const Vec3d& x, double r) {
  const double ball = dem::sphere_volume(r), unit_ball = ball_beyond(-1);
  double inside = ball;
  Vec3d low{-1, -1, -1}, high{1, 1, 1};
  for (int a = 0; a < 3 && inside > 0; ++a) {
    if (grid.periodic[a]) continue;
    if (!holds.low[a]) low[a] = std::clamp(-x[a] / r, -1.0, 1.0);
    if (!holds.high[a]) high[a] = std::clamp((grid.length[a] - x[a]) / r, -1.0, 1.0);
    if (low[a] == -1 && high[a] == 1) continue;
    const double left = low[a] < high[a] ? ball * (ball_in_box(low, high) / unit_ball) : 0;
    const double below = ball_beyond(-low[a]), above = ball_beyond(high[a]);
    if (below + above == 0) continue;  // touches the side
    outside_.volume[a][0] += (inside - left) * (below / (below + above));
    outside_.volume[a][1] += (inside - left) * (above / (below + above));
    if (left == 0) ++outside_.grains[a][below > above ? 0 : 1];
    inside = left;
  }
  return inside;
}

void Mapping::put_hats(const fluid::Grid& grid, int axis, const std::vector<Vec3d>& x) {
  stencils_.resize(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) stencils_[i] = stencil(grid, axis, x[i]);
  spread_.clear(), spreads_.clear();
  if (wide_.empty()) return;
  constexpr Index none = -1;
  std::vector<Index> at(axis < 0 ? grid.cells() : grid.face_count(axis), none);
  for (const WideParts& w : wide_) {
    const std::size_t first = spread_.size();
    for (std::size_t p = w.first; p < w.end; ++p) {
      const Stencil s = stencil(grid, axis, parts_[p].x);
      for (int e = 0; e < 8; ++e) {
        Index& slot = at[s.point[e]];
        if (slot == none) slot = static_cast<Index>(spread_.size()), spread_.push_back({s.point[e], {}, 0});
        spread_[slot].m.add(parts_[p].v * s.w[e], s.from(e));
      }
    }
    for (std::size_t k = first; k < spread_.size(); ++k) at[spread_[k].face] = none;
    spreads_.push_back({w.grain, first, spread_.size()});
  }
}

// Which grains are held, or pressed hardly less than those around them. From hats about cells.
void Mapping::find_bearing(const fluid::Grid& grid, const dem::GrainRow* grains,
                           const std::vector<double>& squeeze) {
  const std::size_t n = stencils_.size();
  // The mean stress in a grain is some sum of forces over its area, so that grains of all sizes compare.
  std::vector<double> stress(n);
  for (std::size_t i = 0; i < n; ++i) stress[i] = squeeze[i] / (grains[i].r * grains[i].r);
  std::vector<double> solid(grid.cells(), 0), sum(grid.cells(), 0);  // m3; and times the stress
  for (std::size_t i = 0; i < n; ++i)
    for (int e = 0; e < 8; ++e) {
      const double v = volume_[i] * stencils_[i].w[e];
      solid[stencils_[i].point[e]] += v, sum[stencils_[i].point[e]] += v * stress[i];
    }
  for (const WideParts& w : spreads_)
    for (std::size_t k = w.first; k < w.end; ++k)
      solid[spread_[k].face] += spread_[k].m.m0, sum[spread_[k].face] += spread_[k].m.m0 * stress[w.grain];
  const auto bears = [&](std::size_t i, double around) {
    const bool held = grains[i].inverse_inertia == 0;
    return held || (squeeze[i] > 0 && stress[i] >= loose_below * around);
  };
  bears_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    double around = 0;
    for (int e = 0; e < 8; ++e) {
      const Index c = stencils_[i].point[e];
      if (solid[c] > 0) around += stencils_[i].w[e] * (sum[c] / solid[c]);
    }
    bears_[i] = bears(i, around);
  }
  // A wide grain would compare with itself.
  for (const WideParts& w : spreads_) {
    double others = 0, stresses = 0;
    for (std::size_t k = w.first; k < w.end; ++k) {
      const double own = spread_[k].m.m0;
      others += own * (solid[spread_[k].face] - own);
      stresses += own * (sum[spread_[k].face] - own * stress[w.grain]);
    }
    bears_[w.grain] = bears(w.grain, others > 0 ? stresses / others : 0);
  }
}

// Makes the hats weights b; and psi_ of the axis.
void Mapping::weigh(const fluid::Grid& grid, int axis, bool open_low, bool open_high) {
  std::vector<Stencil>& faces = stencils_;
  const std::size_t count = grid.face_count(axis), n = faces.size();
  std::vector<Moments> moments(count), loose(count);
  for (std::size_t i = 0; i < n; ++i) {
    std::vector<Moments>& kind = bears_[i] ? moments : loose;
    for (int e = 0; e < 8; ++e) kind[faces[i].point[e]].add(volume_[i] * faces[i].w[e], faces[i].from(e));
  }
  for (const WideParts& w : spreads_)
    for (std::size_t k = w.first; k < w.end; ++k)
      (bears_[w.grain] ? moments : loose)[spread_[k].face].add(1, spread_[k].m);
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
        slope[f] = affine_correction(m, m.m0 / hat, psi_min, side ? axis : -1);
        const double few = std::max(1.0, psi_min * hat / solids);
        scale[f] = area / (few * (m.m0 + dot(slope[f], m.m1))), psi_[axis][f] *= few;
      }
  for (std::size_t i = 0; i < n; ++i)
    for (int e = 0; e < 8; ++e) {
      const Index f = faces[i].point[e];
      const double counts = bears_[i] ? 1 : loose_share[f];
      faces[i].w[e] *= scale[f] * counts * volume_[i] * (1 + dot(slope[f], faces[i].from(e)));
    }
  for (const WideParts& w : spreads_)
    for (std::size_t k = w.first; k < w.end; ++k) {
      Spread& s = spread_[k];
      const double counts = bears_[w.grain] ? 1 : loose_share[s.face];
      s.b = scale[s.face] * counts * (s.m.m0 + dot(slope[s.face], s.m.m1));
    }
}

// Weights of other grains to 16 bits, in units of scale_; those of wide grains make up for what that leaves
// of a face's sum, or else scale_ does.
void Mapping::round(int axis, const std::vector<double>& top_layer) {
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
      if (top_layer[i] != 0) layer_[axis][f] += top_layer[i] * b;
    }
  scale_[axis].assign(count, 0);
  for (std::size_t f = 0; f < count; ++f)
    if (rounded[f] != 0) scale_[axis][f] = exact[f] / rounded[f];

  std::vector<Spread*> heaviest(spread_.empty() ? 0 : count, nullptr);
  for (Spread& s : spread_)
    if (Spread*& h = heaviest[s.face]; s.b != 0 && (!h || std::abs(s.b) > std::abs(h->b))) h = &s;
  for (std::size_t f = 0; f < heaviest.size(); ++f)
    if (heaviest[f]) {
      scale_[axis][f] = largest[f] > 0 ? largest[f] / most : 1;
      heaviest[f]->b += exact[f] - scale_[axis][f] * rounded[f];
    }
  for (const WideParts& w : spreads_)
    for (std::size_t k = w.first; k < w.end; ++k) {
      Spread& s = spread_[k];
      if (s.b == 0) continue;
      s.b /= scale_[axis][s.face];
      if (top_layer[w.grain] != 0) layer_[axis][s.face] += top_layer[w.grain] * s.b;
    }
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

void Mapping::lay_out_wide(int axis) {
  constexpr Index none = -1;
  std::vector<Index> slot_of(spreads_.empty() ? 0 : psi_[axis].size(), none);
  auto next = spreads_.begin();  // as chunks, in the order of grains
  for (Chunk& c : chunks_) {
    c.first_wide_face[axis] = static_cast<Index>(c.wide_face.size());
    for (std::size_t w = 0; next != spreads_.end() && next->grain < c.end; ++next, ++w) {
      if (axis == 0) c.wide.push_back({next->grain, {}});
      c.wide[w].shares[axis][0] = static_cast<Index>(c.share.size());
      for (std::size_t k = next->first; k < next->end; ++k) {
        if (spread_[k].b == 0) continue;
        Index& slot = slot_of[spread_[k].face];
        if (slot == none) {
          slot = static_cast<Index>(c.wide_face.size());
          c.wide_face.push_back(spread_[k].face);
        }
        c.share.push_back({slot, spread_[k].b});
      }
      c.wide[w].shares[axis][1] = static_cast<Index>(c.share.size());
    }
    for (auto s = static_cast<std::size_t>(c.first_wide_face[axis]); s < c.wide_face.size(); ++s)
      slot_of[c.wide_face[s]] = none;
  }
}

}  // namespace moraine::coupling
