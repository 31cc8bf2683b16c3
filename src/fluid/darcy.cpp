#include "fluid/darcy.hpp"

#include <algorithm>
#include <cmath>

#include "error.hpp"

namespace moraine::fluid {
namespace {

constexpr const char* axis_name[] = {"x", "y", "z"};

void check_grid(const Grid& g) {
  for (int a = 0; a < 3; ++a) {
    if (g.n[a] < 1)
      throw error("pore water: ", g.n[a], " cells along ", axis_name[a], "; expected one or more");
    if (!(g.length[a] > 0) || !std::isfinite(g.length[a]))
      throw error("pore water: the grid is ", g.length[a], " m long along ", axis_name[a],
                  "; expected a positive length");
  }
}

void check_side(const Side& s, int axis, bool high) {
  const auto refuse = [&](const auto&... what) {
    throw error("pore water: the ", high ? "high" : "low", " side of ", axis_name[axis], " ", what...);
  };
  for (const double v : {s.value, s.amplitude, s.frequency, s.phase})
    if (!std::isfinite(v)) refuse("has the value ", v, "; expected a finite number");
  if (s.kind == Side::Kind::closed && (s.value != 0 || s.changes()))
    refuse("is closed and yet has a value (", s.value, ") or amplitude (", s.amplitude,
           "); expected 0 for both, or a side of given pressure or flux");
  if (s.frequency < 0) refuse("has the frequency ", s.frequency, " Hz; expected 0 or more");
  if (s.amplitude != 0 && s.frequency == 0)
    refuse("has the amplitude ", s.amplitude,
           " but no frequency; expected a frequency in Hz, or no amplitude");
}

}  // namespace

Darcy::Darcy(const Grid& grid, const Sides& sides) : grid_(grid), sides_(sides) {
  check_grid(grid);
  for (int a = 0; a < 3; ++a)
    if (!grid.periodic[a]) check_side(sides.low[a], a, false), check_side(sides.high[a], a, true);
  storage_.assign(grid.cells(), 0);
  for (int a = 0; a < 3; ++a) transmissibility_[a].assign(grid.face_count(a), 0);
  zeros_.assign(grid.n[0], 0);
  for (auto& row : rows_) row.assign(grid.n[0], 0);
}

void Darcy::set(const Grid& grid, const Medium& m) {
  if (grid.n != grid_.n || grid.periodic != grid_.periodic)
    throw error("pore water: a grid of ", grid.n[0], " x ", grid.n[1], " x ", grid.n[2], " cells where ",
                grid_.n[0], " x ", grid_.n[1], " x ", grid_.n[2],
                " were before; only its lengths may change");
  check_grid(grid);
  const std::size_t cells = grid.cells();
  if (m.porosity.size() != cells || m.permeability.size() != cells)
    throw error("pore water: ", m.porosity.size(), " porosities and ", m.permeability.size(),
                " permeabilities for ", cells, " cells; expected one of each per cell");
  if (!(m.viscosity > 0) || !std::isfinite(m.viscosity))
    throw error("pore water: viscosity ", m.viscosity, " Pa s; expected a positive number");
  if (!(m.compressibility > 0) || !std::isfinite(m.compressibility))
    throw error("pore water: compressibility ", m.compressibility, " 1/Pa; expected a positive number");
  for (std::size_t c = 0; c < cells; ++c) {
    const auto refuse = [&](const char* what, double value, const char* expected) {
      const std::size_t nx = grid.n[0], ny = grid.n[1];
      throw error("pore water: ", what, " ", value, " in cell ", c, " (", c % nx, ", ", c / nx % ny, ", ",
                  c / nx / ny, "); expected ", expected);
    };
    if (!(m.porosity[c] > 0 && m.porosity[c] <= 1))
      refuse("porosity", m.porosity[c], "more than 0 and at most 1");
    if (!(m.permeability[c] >= 0) || !std::isfinite(m.permeability[c]))
      refuse("permeability", m.permeability[c], "m2, 0 or more and finite");
  }

  for (int a = 0; a < 3; ++a)
    for (const WallGap& gap : m.gap[a])
      if (!(gap.k > 0) || !std::isfinite(gap.k) || !(gap.width >= 0 && gap.width < 0.5 * grid.h(a)))
        throw error("pore water: a gap of ", gap.width, " m beside a side of ", axis_name[a], ", and ", gap.k,
                    " of the permeability behind it; expected 0 to less than half a cell, and more than 0");

  grid_ = grid;
  ++version_;
  const double volume = grid.cell_volume();
  for (std::size_t c = 0; c < cells; ++c) storage_[c] = m.compressibility * m.porosity[c] * volume;
  for (int a = 0; a < 3; ++a) {
    const double factor = grid.face_area(a) / (m.viscosity * grid.h(a));
    const auto& gap = m.gap[a];
    std::vector<double> k = m.permeability;
    if (!grid.periodic[a]) {
      const bool both = grid.n[a] == 1;
      const double low = both ? std::min(gap[0].k, gap[1].k) : gap[0].k;
      each_side_cell(a, false, [&](std::size_t c, std::size_t) { k[c] *= low; });
      if (!both) each_side_cell(a, true, [&](std::size_t c, std::size_t) { k[c] *= gap[1].k; });
    }
    each_face(a, [&](int, std::size_t f, std::size_t low, std::size_t high) {
      double& T = transmissibility_[a][f];
      if (low == no_cell || high == no_cell) {
        const Side& side = low == no_cell ? sides_.low[a] : sides_.high[a];
        const double way = 0.5 - gap[low == no_cell ? 0 : 1].width / grid.h(a);  // in cells
        T = side.kind == Side::Kind::pressure ? factor / way * k[low == no_cell ? high : low] : 0;
      } else {
        const double sum = k[low] + k[high];
        T = sum > 0 ? factor * (2 * k[low] * (k[high] / sum)) : 0;
      }
    });
  }
}

// out = (C p or nothing) + s sum of T (p - neighbour's p), row by row; neighbours beyond a side have the
// pressures in `beyond`.
template <bool with_storage>
void Darcy::sweep(double s, const Beyond& beyond, const double* p, double* out) const {
  const int nx = grid_.n[0], ny = grid_.n[1], nz = grid_.n[2];
  const int fx = grid_.faces(0), fy = grid_.faces(1), fz = grid_.faces(2);
  const auto& T = transmissibility_;
  const std::size_t plane = static_cast<std::size_t>(nx) * ny;
  for (int k = 0; k < nz; ++k) {
    const double* layer = p + k * plane;
    const double* down = k > 0 ? layer - plane : fz == nz ? p + (nz - 1) * plane : nullptr;
    const double* up = k < nz - 1 ? layer + plane : fz == nz ? p : nullptr;
    const double* t_down = T[2].data() + k * plane;
    const double* t_up = T[2].data() + (k + 1 < fz ? k + 1 : 0) * plane;
    const double* t_y = T[1].data() + static_cast<std::size_t>(k) * fy * nx;
    for (int j = 0; j < ny; ++j) {
      const std::size_t row = static_cast<std::size_t>(j) * nx;
      const double* here = layer + row;
      const double* south = j > 0 ? here - nx : fy == ny ? layer + plane - nx : beyond.y[0];
      const double* north = j < ny - 1 ? here + nx : fy == ny ? layer : beyond.y[1];
      const double* below = down ? down + row : beyond.z[0];
      const double* above = up ? up + row : beyond.z[1];
      const double* t_south = t_y + row;
      const double* t_north = t_y + static_cast<std::size_t>(j + 1 < fy ? j + 1 : 0) * nx;
      const double* t_below = t_down + row;
      const double* t_above = t_up + row;
      const double* t_x = T[0].data() + (k * static_cast<std::size_t>(ny) + j) * fx;
      const double* C = storage_.data() + k * plane + row;
      double* __restrict to = out + k * plane + row;
      const auto cell = [&](int i, double west, double east, double t_west, double t_east) {
        const double q = here[i];
        const double x = t_west * (q - west) + t_east * (q - east);
        const double y = t_south[i] * (q - south[i]) + t_north[i] * (q - north[i]);
        const double z = t_below[i] * (q - below[i]) + t_above[i] * (q - above[i]);
        to[i] = (with_storage ? C[i] * q : 0) + s * ((x + y) + z);
      };
      const bool ring = fx == nx;
      const double west = ring ? here[nx - 1] : beyond.x[0], east = ring ? here[0] : beyond.x[1];
      const double t_east = ring ? t_x[0] : t_x[nx];
      if (nx == 1) {
        cell(0, west, east, t_x[0], t_east);
        continue;
      }
      cell(0, west, here[1], t_x[0], t_x[1]);
      for (int i = 1; i < nx - 1; ++i) cell(i, here[i - 1], here[i + 1], t_x[i], t_x[i + 1]);
      cell(nx - 1, here[nx - 2], east, t_x[nx - 1], t_east);
    }
  }
}

void Darcy::apply(double s, const double* p, double* out) const {
  const double* zero = zeros_.data();
  sweep<true>(s, Beyond{{0, 0}, {zero, zero}, {zero, zero}}, p, out);
}

void Darcy::apply_flow(double s, const double* p, double* out) const {
  const double* zero = zeros_.data();
  sweep<false>(s, Beyond{{0, 0}, {zero, zero}, {zero, zero}}, p, out);
}

void Darcy::diagonal(double s, double* out) const {
  std::copy(storage_.begin(), storage_.end(), out);
  for (int a = 0; a < 3; ++a)
    each_face(a, [&](int, std::size_t f, std::size_t low, std::size_t high) {
      if (low == high) return;
      if (low != no_cell) out[low] += s * transmissibility_[a][f];
      if (high != no_cell) out[high] += s * transmissibility_[a][f];
    });
}

template <class Visit>
void Darcy::each_side_cell(int axis, bool high, Visit&& visit) const {
  const auto& n = grid_.n;
  std::array<int, 3> begin{}, end = n;
  if (high) begin[axis] = n[axis] - 1;
  end[axis] = begin[axis] + 1;
  const int up = high ? 1 : 0;
  for (int k = begin[2]; k < end[2]; ++k)
    for (int j = begin[1]; j < end[1]; ++j)
      for (int i = begin[0]; i < end[0]; ++i)
        visit(grid_.cell(i, j, k),
              grid_.face(axis, axis == 0 ? i + up : i, axis == 1 ? j + up : j, axis == 2 ? k + up : k));
}

void Darcy::add_sides(double s, double t, double* out) const {
  for (int a = 0; a < 3; ++a) {
    if (grid_.periodic[a]) continue;
    for (const bool high : {false, true}) {
      const Side& side = high ? sides_.high[a] : sides_.low[a];
      if (side.kind == Side::Kind::closed) continue;
      const double value = side.at(t);
      if (side.kind == Side::Kind::flux) {
        const double in = s * (value * grid_.face_area(a));
        each_side_cell(a, high, [&](std::size_t c, std::size_t) { out[c] += in; });
      } else if (value != 0) {
        const auto& T = transmissibility_[a];
        each_side_cell(a, high, [&](std::size_t c, std::size_t f) { out[c] += s * (T[f] * value); });
      }
    }
  }
}

double Darcy::pressure_beyond(const Side& side, double t) const {
  return side.kind == Side::Kind::pressure ? side.at(t) : 0;
}

void Darcy::outflow(double t, const double* p, double* out) const {
  Beyond beyond;
  beyond.x = {pressure_beyond(sides_.low[0], t), pressure_beyond(sides_.high[0], t)};
  for (int a = 1; a < 3; ++a)
    for (int high = 0; high < 2; ++high) {
      auto& row = rows_[2 * (a - 1) + high];
      std::fill(row.begin(), row.end(), pressure_beyond(high ? sides_.high[a] : sides_.low[a], t));
      (a == 1 ? beyond.y : beyond.z)[high] = row.data();
    }
  sweep<false>(1, beyond, p, out);
  for (int a = 0; a < 3; ++a) {
    if (grid_.periodic[a]) continue;
    for (const bool high : {false, true}) {
      const Side& side = high ? sides_.high[a] : sides_.low[a];
      if (side.kind != Side::Kind::flux) continue;
      const double in = side.at(t) * grid_.face_area(a);
      each_side_cell(a, high, [&](std::size_t c, std::size_t) { out[c] -= in; });
    }
  }
}

void Darcy::flux(int axis, double t, const double* p, double* out) const {
  const auto& T = transmissibility_[axis];
  const Side &below = sides_.low[axis], &above = sides_.high[axis];
  const double area = grid_.face_area(axis), p_below = below.at(t), p_above = above.at(t);
  each_face(axis, [&](int, std::size_t f, std::size_t low, std::size_t high) {
    if (low == no_cell)
      out[f] = below.kind == Side::Kind::flux ? p_below * area : T[f] * (p_below - p[high]);
    else if (high == no_cell)
      out[f] = above.kind == Side::Kind::flux ? -(p_above * area) : T[f] * (p[low] - p_above);
    else
      out[f] = T[f] * (p[low] - p[high]);
  });
}

Exchanged Darcy::inflow(double t, const double* p) const {
  Exchanged in;
  for (int a = 0; a < 3; ++a) {
    if (grid_.periodic[a]) continue;
    for (const bool high : {false, true}) {
      const Side& side = high ? sides_.high[a] : sides_.low[a];
      if (side.kind == Side::Kind::closed) continue;
      const double value = side.at(t), area = grid_.face_area(a);
      double& sum = (high ? in.high : in.low)[a];
      if (side.kind == Side::Kind::flux)
        sum = value * area * static_cast<double>(grid_.cells() / grid_.n[a]);
      else
        each_side_cell(
            a, high, [&](std::size_t c, std::size_t f) { sum += transmissibility_[a][f] * (value - p[c]); });
    }
  }
  return in;
}

// p (L p - b), and what of b is no loss.
double Darcy::dissipation(double t, const double* p, const double* out) const {
  double sum = 0;
  for (std::size_t c = 0; c < grid_.cells(); ++c) sum += p[c] * out[c];
  for (int a = 0; a < 3; ++a) {
    if (grid_.periodic[a]) continue;
    for (const bool high : {false, true}) {
      const Side& side = high ? sides_.high[a] : sides_.low[a];
      if (side.kind == Side::Kind::closed) continue;
      const double value = side.at(t), area = grid_.face_area(a);
      const bool flux = side.kind == Side::Kind::flux;
      each_side_cell(a, high, [&](std::size_t c, std::size_t f) {
        sum += flux ? p[c] * value * area : value * (transmissibility_[a][f] * (value - p[c]));
      });
    }
  }
  return sum;
}

}  // namespace moraine::fluid
