#include "coupling/mapping.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace moraine::coupling {

using dem::Vec3d;

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
  std::fill(c.wide_sum.begin(), c.wide_sum.end(), 0.0);
  for (const Wide& w : c.wide) {
    const Pack d = displacement(w.grain);
    for (int axis = 0; axis < 3; ++axis)
      for (Index s = w.shares[axis][0]; s < w.shares[axis][1]; ++s)
        c.wide_sum[c.share[s].slot] += unit * (c.share[s].b * d[axis]);
  }
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
      for (Index s = c.first_wide_face[axis]; s < c.first_wide_face[axis + 1]; ++s)
        to[c.wide_face[s]] += c.wide_sum[s];
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
  for (const Wide& w : c.wide) {
    Vec3d f{0, 0, 0};
    for (int axis = 0; axis < 3; ++axis)
      for (Index s = w.shares[axis][0]; s < w.shares[axis][1]; ++s)
        f[axis] += c.share[s].b * g[axis][c.wide_face[c.share[s].slot]];
    force[w.grain].f = f;
  }
}

void Mapping::apply(const std::vector<Vec3d>& d, Faces& u) const {
  for (auto& axis : u) std::fill(axis.begin(), axis.end(), 0.0);
  for (const Chunk& c : chunks_) {
    for (Index i = c.begin; i < c.end; ++i)
      for (int axis = 0; axis < 3; ++axis)
        for (int e = 0; e < 8; ++e) {
          const Index f = c.octets[weights_[i].octet[axis]].face[e];
          u[axis][f] += scale_[axis][f] * (weights_[i].b[axis][e] * d[i][axis]);
        }
    for (const Wide& w : c.wide)
      for (int axis = 0; axis < 3; ++axis)
        for (Index s = w.shares[axis][0]; s < w.shares[axis][1]; ++s) {
          const Index f = c.wide_face[c.share[s].slot];
          u[axis][f] += scale_[axis][f] * (c.share[s].b * d[w.grain][axis]);
        }
  }
}

}  // namespace moraine::coupling
