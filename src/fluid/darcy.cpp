#include "fluid/darcy.hpp"

#include <algorithm>

#include "error.hpp"

namespace moraine::fluid {

namespace {

// use(i, j, k) for all cells, or (axis >= 0) for the faces of an axis.
template <class Use>
void for_each(const Grid& g, int axis, Use&& use) {
  const int n[3] = {axis == 0 ? g.faces(0) : g.n[0], axis == 1 ? g.faces(1) : g.n[1],
                    axis == 2 ? g.faces(2) : g.n[2]};
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i) use(i, j, k);
}

// The cells below and above a face, -1 beyond a side.
struct Cells {
  std::int64_t low, high;
};
Cells beside(const Grid& g, int axis, int i, int j, int k) {
  int at[3] = {i, j, k};
  Cells c{-1, -1};
  const int f = at[axis];
  if (f < g.n[axis]) c.high = static_cast<std::int64_t>(g.cell(at[0], at[1], at[2]));
  at[axis] = f > 0 ? f - 1 : g.n[axis] - 1;
  if (f > 0 || g.periodic[axis]) c.low = static_cast<std::int64_t>(g.cell(at[0], at[1], at[2]));
  return c;
}

}  // namespace

void check_sides(const Grid& grid, const Sides& sides) {
  for (int a = 0; a < 3; ++a) {
    if (grid.periodic[a]) continue;
    for (const bool high : {false, true}) {
      const Side& s = high ? sides.high[a] : sides.low[a];
      const auto fail = [&](const auto&... why) {
        throw error("pore water: ", high ? "high" : "low", " side along ", "xyz"[a], ": ", why...);
      };
      if (s.kind == Side::Kind::closed && (s.value != 0 || s.amplitude != 0))
        fail("closed, with a value of ", s.value, " and an amplitude of ", s.amplitude, "; expected none");
      if (s.amplitude != 0 && !(s.frequency > 0))
        fail("an amplitude of ", s.amplitude, " at a frequency of ", s.frequency, " Hz; expected > 0 Hz");
      if (s.frequency < 0) fail("frequency = ", s.frequency, " Hz; expected >= 0 Hz");
    }
  }
}

Darcy::Darcy(const Grid& grid, const Sides& sides) : grid_(grid), sides_(sides) {
  check_sides(grid, sides);
  storage_.resize(grid.cells()), outflow_.resize(grid.cells());
  neighbour_.resize(grid.cells()), link_.resize(grid.cells());
  for (std::size_t c = 0; c < grid.cells(); ++c) neighbour_[c].fill(static_cast<int>(c));
  for (int a = 0; a < 3; ++a) {
    t_[a].resize(grid.face_count(a));
    for_each(grid, a, [&](int i, int j, int k) {
      const Cells c = beside(grid, a, i, j, k);
      if (c.low >= 0 && c.high >= 0) {
        neighbour_[c.low][2 * a + 1] = static_cast<int>(c.high);
        neighbour_[c.high][2 * a] = static_cast<int>(c.low);
        return;
      }
      const bool high = c.high < 0;
      if ((high ? sides.high : sides.low)[a].kind != Side::Kind::closed)
        openings_.push_back(
            {static_cast<std::size_t>(high ? c.low : c.high), grid.face(a, i, j, k), a, high});
    });
  }
}

void Darcy::set(const Grid& grid, const Medium& m) {
  grid_ = grid;
  if (!(m.viscosity > 0)) throw error("pore water: viscosity = ", m.viscosity, " Pa s: expected > 0 Pa s");
  if (!(m.compressibility > 0))
    throw error("pore water: compressibility = ", m.compressibility, " 1/Pa: expected > 0 1/Pa");
  for_each(grid, -1, [&](int i, int j, int k) {
    const std::size_t c = grid.cell(i, j, k);
    const double phi = m.porosity[c], perm = m.permeability[c];
    if (!(phi > 0 && phi <= 1))
      throw error("pore water: cell (", i, ", ", j, ", ", k, "): porosity = ", phi,
                  ": expected > 0 and at most 1");
    if (!(perm >= 0 && perm < 1e300))
      throw error("pore water: cell (", i, ", ", j, ", ", k, "): permeability = ", perm,
                  " m2: expected >= 0 m2");
    storage_[c] = m.compressibility * phi * grid.cell_volume();
    link_[c].fill(0);
  });
  std::fill(outflow_.begin(), outflow_.end(), 0.0);
  for (int a = 0; a < 3; ++a) {
    const double area = grid.face_area(a), h = grid.h(a);
    for_each(grid, a, [&](int i, int j, int k) {
      const Cells c = beside(grid, a, i, j, k);
      double& t = t_[a][grid.face(a, i, j, k)];
      t = 0;
      if (c.low < 0 || c.high < 0) return;
      const double low = m.permeability[c.low], high = m.permeability[c.high];
      if (low + high > 0) t = area * (2 * low * high / (low + high)) / (m.viscosity * h);
      link_[c.low][2 * a + 1] = t, link_[c.high][2 * a] = t;
      outflow_[c.low] += t, outflow_[c.high] += t;
    });
  }
  for (const Opening& o : openings_) {
    if (side(o).kind != Side::Kind::pressure) continue;
    const double t = grid.face_area(o.axis) * m.permeability[o.cell] / (m.viscosity * grid.h(o.axis) / 2);
    t_[o.axis][o.face] = t;
    outflow_[o.cell] += t;
  }
}

void Darcy::apply(double w, double dt, const double* x, double* y) const {
  const std::size_t n = storage_.size();
  for (std::size_t c = 0; c < n; ++c) {
    const auto& at = neighbour_[c];
    const auto& t = link_[c];
    const double in = ((t[0] * x[at[0]] + t[1] * x[at[1]]) + (t[2] * x[at[2]] + t[3] * x[at[3]])) +
                      (t[4] * x[at[4]] + t[5] * x[at[5]]);
    y[c] = (w * storage_[c] + dt * outflow_[c]) * x[c] - dt * in;
  }
}

void Darcy::add_flow(double factor, const double* x, double* y) const {
  const std::size_t n = storage_.size();
  for (std::size_t c = 0; c < n; ++c) {
    const auto& at = neighbour_[c];
    const auto& t = link_[c];
    double sum = 0;  // of differences, so that what leaves one cell enters the other to the bit
    for (int k = 0; k < 6; ++k) sum += t[k] * (x[c] - x[at[k]]);
    y[c] += factor * sum;
  }
}

double Darcy::inflow(const Opening& o, double t, double p) const {
  const Side& s = side(o);
  if (s.kind == Side::Kind::flux) return s.at(t) * grid_.face_area(o.axis);
  return t_[o.axis][o.face] * (s.at(t) - p);
}

void Darcy::add_sides(double factor, double t, double* y) const {
  for (const Opening& o : openings_) y[o.cell] += factor * inflow(o, t, 0);
}

void Darcy::add_inflow(double factor, double t, const std::vector<double>& p, double* y) const {
  for (const Opening& o : openings_) y[o.cell] += factor * inflow(o, t, p[o.cell]);
}

Exchanged Darcy::through_sides(double t, double dt, const std::vector<double>& p) const {
  Exchanged sum;
  for (const Opening& o : openings_) (o.high ? sum.high : sum.low)[o.axis] += dt * inflow(o, t, p[o.cell]);
  return sum;
}

void Darcy::flux(int axis, double t, const std::vector<double>& p, std::vector<double>& out) const {
  out.assign(grid_.face_count(axis), 0);
  for_each(grid_, axis, [&](int i, int j, int k) {
    const Cells c = beside(grid_, axis, i, j, k);
    const std::size_t f = grid_.face(axis, i, j, k);
    if (c.low >= 0 && c.high >= 0) out[f] = t_[axis][f] * (p[c.low] - p[c.high]);
  });
  for (const Opening& o : openings_)
    if (o.axis == axis) out[o.face] = (o.high ? -1 : 1) * inflow(o, t, p[o.cell]);
}

double Darcy::dissipation(double t, const std::vector<double>& p) const {
  double sum = 0;
  for (std::size_t c = 0; c < storage_.size(); ++c)
    for (int k = 1; k < 6; k += 2) {  // each face once
      const double drop = p[c] - p[neighbour_[c][k]];
      sum += link_[c][k] * drop * drop;
    }
  for (const Opening& o : openings_)
    if (side(o).kind == Side::Kind::pressure) {
      const double drop = side(o).at(t) - p[o.cell];
      sum += t_[o.axis][o.face] * drop * drop;
    }
  return sum;
}

}  // namespace moraine::fluid
