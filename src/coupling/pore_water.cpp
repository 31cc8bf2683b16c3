#include "coupling/pore_water.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "coupling/mapping.hpp"
#include "coupling/wall_gap.hpp"
#include "dem/engine_parts.hpp"
#include "dem/spectrum.hpp"
#include "dem/touching.hpp"
#include "error.hpp"
#include "fluid/step.hpp"
#include "memory.hpp"

namespace moraine::coupling {

namespace {

using dem::Vec3d;

constexpr double map_lasts = 0.01;  // of a cell, that grains may move before the weights are made anew
constexpr double most_of_limit =
    0.9;  // of the step at which grains and water would swing up: contacts come and go
constexpr int power_iterations = 60;
constexpr double tolerable = 0.02;  // of error_of_few_cells(), to say nothing

// Means over what each cell of a grid of `to` cells covers of one of `from`, in parts of their lengths.
std::vector<double> on_another_grid(std::vector<double> p, const std::vector<std::int32_t>& from,
                                    const std::array<int, 3>& to) {
  std::array<int, 3> n{from.at(0), from.at(1), from.at(2)};
  for (int a = 0; a < 3; ++a) {
    const int before = n[a];
    n[a] = to[a];
    const int stride = a == 0   ? 1
                       : a == 1 ? n[0]
                                : n[0] * n[1],
              rest = a == 2   ? 1
                     : a == 1 ? n[2]
                              : n[1] * n[2];
    std::vector<double> next(static_cast<std::size_t>(stride) * n[a] * rest, 0);
    for (int r = 0; r < rest; ++r)
      for (int i = 0; i < n[a]; ++i)
        for (int j = 0; j < before; ++j) {
          // In whole numbers, so that equal grids give equal bits.
          const std::int64_t low = std::max<std::int64_t>(std::int64_t{i} * before, std::int64_t{j} * n[a]),
                             high = std::min<std::int64_t>((i + std::int64_t{1}) * before,
                                                           (j + std::int64_t{1}) * n[a]);
          if (low >= high) continue;
          const double share = static_cast<double>(high - low) / before;
          for (int s = 0; s < stride; ++s)
            next[(static_cast<std::size_t>(r) * n[a] + i) * stride + s] +=
                share * p[(static_cast<std::size_t>(r) * before + j) * stride + s];
        }
    p = std::move(next);
  }
  return p;
}

bool has_wall(const dem::Scene& s) { return s.top_wall.drive != dem::TopWall::Drive::none; }

class GridWater final : public PoreWater {
 public:
  GridWater(const Water& water, const dem::Scene& scene, const dem::State& s, const WaterState& before,
            bool restart)
      : water_(water),
        scene_(scene),
        grid_(grid_of(water, scene, s, before, restart)),
        step_(grid_, sides_of(water), options_of(water)) {
    const auto n = static_cast<std::size_t>(s.size());
    x_.resize(n), top_layer_.resize(n), volume_.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      x_[i] = s.x[i], top_layer_[i] = s.role[i] == dem::Role::top;
      volume_[i] = dem::sphere_volume(s.r[i]), solids_ += volume_[i];
    }
    grains_ = dem::grain_rows(scene, s);
    for (int a = 0; a < 3; ++a) {
      u_[a].resize(grid_.face_count(a)), g_[a].resize(grid_.face_count(a)),
          push_[a].resize(grid_.face_count(a));
    }
    div_u_.resize(grid_.cells());
    closed_ = water.top == TopSide::impermeable;

    if (restart) {
      now_ = before;
      map(before.x_map);
      now_.moved = before.moved;
      mapping_.start_from(s.x);
      t_ = scene.time(s.step);
      gradients(t_);
      stale_ = now_.moved > map_lasts * least_cell();
      under_way_ = true;
    } else {
      map(s.x);
      now_.wall_z = s.wall_z;
      begin(before);
      t_ = scene.time(s.step);
    }
    choose_interval(s, restart);
  }

  bool stale() const override { return stale_; }

  void remap(const dem::GrainRow* grains, const dem::Drive& drive) override {
    const std::vector<Vec3d> last = mapping_.last();
    std::vector<Vec3d> x(x_.size());
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = grains[i].x;
    // The sum of the largest ways is longer than that of any grain.
    double moved = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (outside(x[i], grains[i].r) && outside(now_.x_map[i], grains[i].r)) continue;
      for (int a = 0; a < 3; ++a) moved = std::max(moved, std::abs(x[i][a] - now_.x_map[i][a]));
    }
    if (has_wall(scene_)) moved += std::abs(drive.wall_z - now_.height_map);
    if (moved < 0.5 * map_lasts * least_cell()) {
      now_.moved = moved;
      return;
    }
    if (has_wall(scene_)) grid_.length[2] = drive.wall_z;
    const Outside before = mapping_.outside();
    map(x);
    book(before);
    mapping_.start_from(last);
  }

  void displace(dem::Index chunk, const dem::GrainRow* grains) override {
    if (interval_ > 1)
      mapping_.displace(chunk, grains);
    else  // the step that led here, if one did
      mapping_.displace(chunk, grains, under_way_ ? scene_.dt : 0);
  }

  dem::WaterReaction solve(const dem::Drive& drive, double t) override {
    const double moved = mapping_.collect(u_);
    const double wall_dz = has_wall(scene_) ? drive.wall_z - now_.wall_z : 0;
    const int nz = grid_.n[2];
    const double column = grid_.face_area(2);
    if (closed_)
      for (std::size_t f = grid_.face(2, 0, 0, nz); f < u_[2].size(); ++f) u_[2][f] = column * wall_dz;
    divergence();

    std::swap(g_, before_);
    if (g_[0].size() != before_[0].size()) g_ = before_;
    const double wall_before = now_.wall_pressure;
    if (t > t_) {
      // Not t - t_, whose last bits change from step to step: a factor of the matrix belongs to one step.
      const double dt = static_cast<double>(interval_) * scene_.dt;
      const fluid::Exchanged in = step_.step(t, dt, div_u_, now_.q, now_.p);
      // What grains push out through a drained wall that does not follow them is water, too.
      now_.drained_top += (solids_through(2, true) - scene_.area() * wall_dz) - in.high[2];
      now_.drained_bottom -= solids_through(2, false) + in.low[2];
      for (int a = 0; a < 2; ++a)
        now_.drained_sides += (solids_through(a, true) - solids_through(a, false)) - (in.low[a] + in.high[a]);
      const double dissipation = step_.dissipation();
      now_.dissipated += 0.5 * dt * (now_.dissipation + dissipation);
      now_.dissipation = dissipation;
    }
    t_ = t;
    gradients(t);

    dem::WaterReaction out;
    for (int a = 0; a < 3; ++a) {
      const double* const last = before_[a].data();
      for (std::size_t f = 0; f < g_[a].size(); ++f) out.work += 0.5 * (last[f] + g_[a][f]) * u_[a][f];
    }
    if (closed_)  // their displacement is the wall's
      for (std::size_t f = grid_.face(2, 0, 0, nz); f < u_[2].size(); ++f)
        out.work -= 0.5 * (before_[2][f] + g_[2][f]) * u_[2][f];
    for (std::size_t f = 0; f < g_[0].size(); ++f) out.layer += mapping_.layer()[0][f] * push_[0][f];
    const double m = static_cast<double>(interval_);
    out.layer *= m;
    if (has_wall(scene_)) {
      const double force = now_.wall_pressure * scene_.area();
      out.wall = closed_ ? m * force : force, out.wall_between = closed_ ? 0 : force;
      out.work += 0.5 * (wall_before + now_.wall_pressure) * scene_.area() * wall_dz;
      now_.wall_z = drive.wall_z;
    }
    now_.moved += moved + std::abs(wall_dz);
    stale_ = now_.moved > map_lasts * least_cell();
    ++now_.exchanges;
    under_way_ = true;
    return out;
  }

  void push(dem::Index chunk, const dem::GrainRow* grains, dem::WaterRow* force) override {
    mapping_.push(chunk, push_, force);
    if (interval_ > 1) mapping_.start_from(chunk, grains);
  }

  std::int64_t interval() const override { return interval_; }
  Stability stability() const override { return stability_; }
  WaterState state() const override { return now_; }

  WaterFields fields() const override {
    WaterFields out{grid_, now_.p, mapping_.porosity(), medium_.permeability, {}};
    out.flux.resize(grid_.cells());
    for (int a = 0; a < 3; ++a) {
      std::vector<double> flow(grid_.face_count(a));
      step_.flux(a, t_, now_.p, flow);
      for_each_run(a, [&](std::size_t c, std::size_t low, std::size_t high, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i)
          out.flux[c + i][a] = 0.5 * (flow[low + i] + flow[high + i]) / grid_.face_area(a);
      });
    }
    return out;
  }

  WaterRecord record(bool upper_half) const override {
    WaterRecord r;
    r.least = 1e300, r.most = -1e300;
    const std::size_t first = grid_.cell(0, 0, upper_half ? grid_.n[2] / 2 : 0),
                      count = now_.p.size() - first;
    for (std::size_t c = first; c < now_.p.size(); ++c) {
      r.mean += now_.p[c];
      r.least = std::min(r.least, now_.p[c]), r.most = std::max(r.most, now_.p[c]);
    }
    r.mean /= static_cast<double>(count);
    for (std::size_t c = 0; c < now_.q.size(); ++c)
      r.stored += 0.5 * now_.q[c] * now_.q[c] / step_.storage()[c];
    r.volume = water_volume();
    r.balance = r.volume + now_.drained_top + now_.drained_bottom + now_.drained_sides - now_.volume_0;
    return r;
  }

  std::string solver() const override {
    const fluid::PressureStep::Report r = step_.report();
    std::ostringstream out;
    out.precision(3);
    out << r.solver;
    if (r.iterations > 0) out << ": " << double(r.iterations) / double(r.solves) << " iterations a solve";
    if (r.factorisations > 0)
      out << ", " << r.factorisations << " factorisations in " << r.solves << " solves";
    return out.str();
  }

  std::string outside() const override {
    const Outside& out = mapping_.outside();
    std::ostringstream text;
    text.precision(3);
    for (int a = 0; a < 3; ++a)
      for (const bool high : {false, true}) {
        const int count = out.grains[a][high];
        if (out.volume[a][high] == 0) continue;
        text << (text.tellp() > 0 ? "; " : "");
        if (count > 0)
          text << count << (count == 1 ? " grain" : " grains");
        else
          text << "parts of grains";
        text << " beyond "
             << "xyz"[a] << " = " << (high ? grid_.length[a] : 0) << " m (" << out.volume[a][high]
             << " m3 of solids)";
        if (side(a, high).kind == fluid::Side::Kind::closed) text << ", where no water can take their place";
      }
    return text.str();
  }

  std::string describe() const override {
    double d = 0;
    for (const double v : volume_) d += 2 * std::cbrt(v * 3 / (4 * std::numbers::pi));
    d /= static_cast<double>(volume_.size());
    std::ostringstream out;
    out.precision(3);
    out << "water: " << grid_.n[0] << " x " << grid_.n[1] << " x " << grid_.n[2] << " cells of " << grid_.h(0)
        << " x " << grid_.h(1) << " x " << grid_.h(2) << " m (" << std::cbrt(grid_.cell_volume()) / d
        << " d), exchange every ";
    if (interval_ == 1)
      out << "step";
    else
      out << interval_ << " steps";
    out << " (at most " << stability_.longest << ")";
    if (const double error = error_of_few_cells(water_); error > tolerable) {
      Water enough = water_;
      while (error_of_few_cells(enough) > tolerable) ++enough.cells[2];
      out << "; so few over the height even out the pressure " << 100 * error
          << " % too fast (fluid.cells_z = " << enough.cells[2] << ": " << 100 * error_of_few_cells(enough)
          << " %)";
    }
    return out.str();
  }

 private:
  static fluid::Grid grid_of(const Water& w, const dem::Scene& scene, const dem::State& s,
                             const WaterState& before, bool restart) {
    fluid::Grid g;
    g.n = w.cells;
    g.periodic = {scene.periodic_x, scene.periodic_y, false};
    g.length = {scene.box.x, scene.box.y, has_wall(scene) ? s.wall_z : w.height};
    if (restart) g.length[2] = before.height_map;
    for (int a = 0; a < 3; ++a)
      if (!(g.length[a] > 0) || g.n[a] < 1)
        throw error("pore water: ", g.n[a], " cells over ", g.length[a], " m along ", "xyz"[a],
                    ": expected at least one cell and a length > 0 m");
    std::ostringstream cells;
    cells << "pore water: " << g.n[0] << " x " << g.n[1] << " x " << g.n[2] << " cells";
    expect_memory(bytes_a_cell * g.n[0] * g.n[1] * g.n[2], cells.str(),
                  "; expected a larger fluid.cell (2 to 3 mean grain diameters), or fewer fluid.cells_x, "
                  "cells_y, cells_z");
    return g;
  }
  static fluid::Sides sides_of(const Water& w) {
    fluid::Sides sides = w.sides;
    if (w.top == TopSide::impermeable) sides.high[2] = {};
    return sides;
  }
  static fluid::SolverOptions options_of(const Water& w) {
    fluid::SolverOptions o;
    o.choice = w.solver == Solver::pcg       ? fluid::SolverChoice::pcg
               : w.solver == Solver::cholmod ? fluid::SolverChoice::cholmod
                                             : fluid::SolverChoice::automatic;
    o.tolerance = w.tolerance;
    return o;
  }

  double least_cell() const { return std::min({grid_.h(0), grid_.h(1), grid_.h(2)}); }

  const fluid::Side& side(int axis, bool high) const {
    static const fluid::Side none;
    if (axis == 2 && high && closed_) return none;
    return high ? water_.sides.high[axis] : water_.sides.low[axis];
  }
  // Pa, where the side has a pressure of its own; others do no work (flux is booked at the cell's).
  double side_pressure(int axis, bool high, double t) const {
    if (grid_.periodic[axis]) return 0;
    const fluid::Side& s = side(axis, high);
    return s.kind == fluid::Side::Kind::pressure ? s.at(t) : 0;
  }

  // m3, of solids through one side, along its axis.
  double solids_through(int axis, bool high) const {
    if (grid_.periodic[axis]) return 0;
    std::array<int, 3> i{}, begin{}, end = grid_.n;
    begin[axis] = high ? grid_.n[axis] : 0, end[axis] = begin[axis] + 1;
    double sum = 0;
    for (i[2] = begin[2]; i[2] < end[2]; ++i[2])
      for (i[1] = begin[1]; i[1] < end[1]; ++i[1])
        for (i[0] = begin[0]; i[0] < end[0]; ++i[0]) sum += u_[axis][grid_.face(axis, i[0], i[1], i[2])];
    return sum;
  }

  // New weights and all that follows from where grains are.
  void map(const std::vector<Vec3d>& x) {
    SidesOf sides;
    for (int a = 0; a < 3; ++a) {
      sides.open_low[a] = side(a, false).kind != fluid::Side::Kind::closed;
      sides.open_high[a] = side(a, true).kind != fluid::Side::Kind::closed;
    }
    sides.holds = holds();
    mapping_.build(grid_, sides, grains_.data(), x, squeeze(x), top_layer_);
    now_.x_map = x, now_.height_map = grid_.length[2], now_.moved = 0;
    medium_.viscosity = water_.viscosity, medium_.compressibility = water_.compressibility;
    medium_.porosity = mapping_.porosity();
    medium_.permeability.resize(grid_.cells());
    for (std::size_t c = 0; c < grid_.cells(); ++c) {
      double& phi = medium_.porosity[c];
      phi = std::clamp(phi, water_.porosity_range[0], water_.porosity_range[1]);
      medium_.permeability[c] = kozeny_carman(water_.k_c, phi);
    }
    if (scene_.floor) medium_.gap[2][0] = wall_gap(grid_, grains_.data(), x, water_.porosity_range, false);
    if (has_wall(scene_)) medium_.gap[2][1] = wall_gap(grid_, grains_.data(), x, water_.porosity_range, true);
    step_.set(grid_, medium_);
  }

  Holds holds() const { return {{false, false, scene_.floor}, {false, false, has_wall(scene_)}}; }
  bool outside(const Vec3d& x, double r) const {
    const Holds held = holds();
    for (int a = 0; a < 3; ++a)
      if (!grid_.periodic[a] &&
          ((!held.low[a] && x[a] + r < 0) || (!held.high[a] && x[a] - r > grid_.length[a])))
        return true;
    return false;
  }
  // Where grains have left since, U counted volume through the side of which the grains' own was no water.
  // By a tight side no water comes for them: the balance then lacks it.
  void book(const Outside& before) {
    for (int a = 0; a < 3; ++a)
      for (const bool high : {false, true}) {
        if (grid_.periodic[a] || side(a, high).kind == fluid::Side::Kind::closed) continue;
        double& drained = a < 2 ? now_.drained_sides : high ? now_.drained_top : now_.drained_bottom;
        drained -= mapping_.outside().volume[a][high] - before.volume[a][high];
      }
  }

  // m, sum of each grain's overlaps, as good as that of its normal forces.
  std::vector<double> squeeze(const std::vector<Vec3d>& x) {
    std::vector<double> sum(x.size(), 0);
    for (std::size_t i = 0; i < x.size(); ++i) {
      dem::GrainRow& g = grains_[i];
      g.x = x[i];
      if (scene_.floor) sum[i] += std::max(g.r - g.x.z, 0.0);
      if (has_wall(scene_)) sum[i] += std::max(g.x.z + g.r - grid_.length[2], 0.0);
    }
    touching_.each(scene_, grains_.data(), static_cast<dem::Index>(x.size()),
                   [&](dem::Index i, dem::Index j, double overlap) { sum[i] += overlap, sum[j] += overlap; });
    return sum;
  }

  // The water an earlier stage has left; on another grid its pressures; else the pressure of the top.
  void begin(const WaterState& before) {
    const std::vector<double>& storage = step_.storage();
    now_.cells.assign(grid_.n.begin(), grid_.n.end());
    now_.q = before.q, now_.p.resize(grid_.cells());
    if (before.q.empty() || before.cells != now_.cells) {
      const std::vector<double> p = before.q.empty()
                                        ? std::vector<double>(grid_.cells(), side_pressure(2, true, 0))
                                        : on_another_grid(before.p, before.cells, grid_.n);
      now_.q.resize(grid_.cells());
      for (std::size_t c = 0; c < grid_.cells(); ++c) now_.q[c] = storage[c] * p[c];
    }
    for (std::size_t c = 0; c < grid_.cells(); ++c) now_.p[c] = now_.q[c] / storage[c];
    now_.volume_0 = water_volume();
  }

  double water_volume() const {
    double volume = scene_.area() * (has_wall(scene_) ? now_.wall_z : grid_.length[2]) - solids_;
    for (const auto& axis : mapping_.outside().volume) volume += axis[0] + axis[1];
    double stored = 0;
    for (const double q : now_.q) stored += q;
    return volume + stored;
  }

  // use(cell, its low face, its high face, count): that many cells that follow each other, and so do their
  // faces along the axis.
  template <class Use>
  void for_each_run(int axis, Use&& use) const {
    const auto& n = grid_.n;
    for (int k = 0; k < n[2]; ++k)
      for (int j = 0; j < n[1]; ++j) {
        int above[3] = {0, j, k};
        ++above[axis];
        const bool wraps = grid_.periodic[axis];
        if (wraps && above[axis] == n[axis]) above[axis] = 0;
        const std::size_t c = grid_.cell(0, j, k), low = grid_.face(axis, 0, j, k),
                          high = grid_.face(axis, above[0], above[1], above[2]);
        const auto count = static_cast<std::size_t>(n[0]);
        if (axis == 0 && wraps) {
          use(c, low, low + 1, count - 1);
          use(c + count - 1, low + count - 1, low, std::size_t{1});
        } else {
          use(c, low, high, count);
        }
      }
  }

  void divergence() {
    std::fill(div_u_.begin(), div_u_.end(), 0.0);
    for (int a = 0; a < 3; ++a) {
      const double* const u = u_[a].data();
      for_each_run(a, [&](std::size_t c, std::size_t low, std::size_t high, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) div_u_[c + i] += u[high + i] - u[low + i];
      });
    }
  }

  // g_f = -(p above - p below), by the closure times the solid fraction; and the pressure on the wall.
  void gradients(double t) {
    const std::vector<double>& p = now_.p;
    for (int a = 0; a < 3; ++a) {
      std::fill(g_[a].begin(), g_[a].end(), 0.0);
      double* const g = g_[a].data();
      for_each_run(a, [&](std::size_t c, std::size_t low, std::size_t high, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) g[high + i] += p[c + i];
        for (std::size_t i = 0; i < count; ++i) g[low + i] -= p[c + i];
      });
      if (!grid_.periodic[a]) {
        const double stride = grid_.h(a) / 2;
        const auto at_side = [&](std::size_t f, std::size_t c, bool high) {
          const fluid::Side& s = side(a, high);
          double beyond = p[c];
          if (s.kind == fluid::Side::Kind::pressure) beyond = s.at(t);
          const fluid::WallGap& gap = medium_.gap[a][high];
          if (s.kind == fluid::Side::Kind::flux)
            beyond =
                p[c] + s.at(t) * water_.viscosity * (stride - gap.width) / (gap.k * medium_.permeability[c]);
          g_[a][f] += high ? -beyond : beyond;
        };
        const auto last = [&](int axis) { return axis == a ? 1 : grid_.n[axis]; };
        for (int k = 0; k < last(2); ++k)
          for (int j = 0; j < last(1); ++j)
            for (int i = 0; i < last(0); ++i) {
              int high[3] = {i, j, k};
              high[a] = grid_.n[a];
              at_side(grid_.face(a, i, j, k), grid_.cell(i, j, k), false);
              const std::size_t f = grid_.face(a, high[0], high[1], high[2]);
              high[a] -= 1;
              at_side(f, grid_.cell(high[0], high[1], high[2]), true);
            }
      }
      if (water_.closure == Closure::pressure_gradient)
        for (std::size_t f = 0; f < g_[a].size(); ++f) g_[a][f] *= mapping_.solid_fraction()[a][f];
      for (std::size_t f = 0; f < g_[a].size(); ++f) push_[a][f] = mapping_.scale()[a][f] * g_[a][f];
    }
    if (!has_wall(scene_)) return;
    if (closed_) {
      const std::size_t first = grid_.cell(0, 0, grid_.n[2] - 1);
      double sum = 0;
      for (std::size_t c = first; c < p.size(); ++c) sum += p[c];
      now_.wall_pressure = sum / static_cast<double>(p.size() - first);
    } else {
      now_.wall_pressure = side_pressure(2, true, t);
    }
  }

  // Largest w^2 of grains (and an impermeable wall) on the stiffness of undrained water, by power iteration
  // on M^-1 B^T D^T C^-1 D B, from above by its last change.
  double water_frequency() {
    const auto chunks = mapping_.chunks();
    std::vector<dem::WaterRow> force(x_.size() + 1, dem::WaterRow{});
    std::vector<Vec3d> d(x_.size());
    std::vector<double> p(grid_.cells());
    Faces u = u_;
    const Faces g = g_, keep_push = push_;
    const std::vector<double> keep = now_.p;
    const double keep_wall = now_.wall_pressure;
    for (std::size_t c = 0; c < p.size(); ++c) {
      int i = static_cast<int>(c) % grid_.n[0], j = static_cast<int>(c) / grid_.n[0] % grid_.n[1],
          k = static_cast<int>(c) / (grid_.n[0] * grid_.n[1]);
      p[c] = ((i + j + k) % 2 ? -1 : 1) + 0.3 * std::sin(1.7 * static_cast<double>(c));
    }
    double lambda = 0, last = 0;
    const Closure closure = water_.closure;
    water_.closure = Closure::full;
    const fluid::Sides sides = water_.sides;
    for (auto* list : {&water_.sides.low, &water_.sides.high})
      for (fluid::Side& s : *list) s.value = s.amplitude = 0;
    for (int n = 0; n < power_iterations; ++n) {
      double norm = 0;
      for (const double v : p) norm += v * v;
      norm = std::sqrt(norm / static_cast<double>(p.size()));
      if (norm == 0) {  // water that no motion presses
        lambda = last = 0;
        break;
      }
      for (double& v : p) v /= norm;
      now_.p = p;
      gradients(0);
      for (dem::Index c = 0; c < chunks; ++c) mapping_.push(c, push_, force.data());
      for (std::size_t i = 0; i < x_.size(); ++i) d[i] = (1 / (scene_.density * volume_[i])) * force[i].f;
      mapping_.apply(d, u);
      if (closed_) {
        const double a = scene_.top_wall.drive == dem::TopWall::Drive::stress
                             ? now_.wall_pressure * scene_.area() / scene_.top_wall.mass
                             : 0;
        for (std::size_t f = grid_.face(2, 0, 0, grid_.n[2]); f < u[2].size(); ++f)
          u[2][f] = grid_.face_area(2) * a;
      }
      std::swap(u, u_);
      divergence();
      std::swap(u, u_);
      last = lambda;
      double along = 0, norm2 = 0;
      for (std::size_t c = 0; c < p.size(); ++c) {
        const double next = div_u_[c] / step_.storage()[c];
        along += next * p[c], norm2 += p[c] * p[c];
        p[c] = next;
      }
      lambda = along / norm2;
    }
    now_.p = keep, now_.wall_pressure = keep_wall, g_ = g, push_ = keep_push, water_.closure = closure,
    water_.sides = sides;
    return lambda + std::abs(lambda - last);
  }

  // A restart keeps the interval that the stage began with, whatever its present contacts would allow.
  void choose_interval(const dem::State& s, bool restart) {
    stability_.w_sk = std::sqrt(dem::spectrum(scene_, s).stiffness);
    // A bed that has not met yet will.
    stability_.w_sk = std::max(stability_.w_sk, 2 / dem::one_contact_step(scene_, s));
    stability_.w_f = std::sqrt(water_frequency());
    const double w = std::hypot(stability_.w_sk, stability_.w_f);
    stability_.longest_dt = most_of_limit * 2 / w;
    stability_.longest = static_cast<std::int64_t>(stability_.longest_dt / scene_.dt);
    if (restart && scene_.exchange_interval > 0) {
      interval_ = scene_.exchange_interval;
      return;
    }
    if (stability_.longest < 1)
      throw error("pore water: grains on the water's stiffness swing at ", stability_.w_f,
                  " rad/s, the contacts at ", stability_.w_sk, " rad/s, so a step of ", scene_.dt,
                  " s is unstable even with an exchange at each; expected a step of at most ",
                  stability_.longest_dt, " s (a smaller model.f), larger cells, or a heavier wall.mass");
    if (water_.interval > stability_.longest)
      throw error("fluid.exchange_interval = ", water_.interval, ": unstable; expected at most ",
                  stability_.longest, " steps of ", scene_.dt, " s (contacts swing at ", stability_.w_sk,
                  " rad/s, the water at ", stability_.w_f, " rad/s), or 0 for an automatic one");
    interval_ = water_.interval > 0 ? water_.interval : stability_.longest;
  }

  Water water_;
  dem::Scene scene_;
  fluid::Grid grid_;
  fluid::PressureStep step_;
  fluid::Medium medium_;
  Mapping mapping_;
  bool closed_ = false, stale_ = false;
  bool under_way_ = false;  // grains have moved since the weights were first made, or will have
  std::vector<Vec3d> x_;
  std::vector<double> volume_;  // m3, of each grain
  std::vector<bool> top_layer_;
  std::vector<dem::GrainRow> grains_;  // as of the weights
  dem::TouchingPairs touching_;
  double solids_ = 0;  // m3, of all grains
  Faces u_, g_, before_;
  Faces push_;  // g_ for Mapping::push
  std::vector<double> div_u_;
  double t_ = 0;
  WaterState now_;
  Stability stability_;
  std::int64_t interval_ = 1;
};

}  // namespace

double error_of_few_cells(const Water& w) {
  const auto drained = [](const fluid::Side& s) { return s.kind == fluid::Side::Kind::pressure; };
  const bool top = w.top == TopSide::drained && drained(w.sides.high[2]), bottom = drained(w.sides.low[2]);
  if (!top && !bottom) return 0;
  const double n = top && bottom ? 0.5 * w.cells[2] : w.cells[2], angle = std::numbers::pi / (2 * n);
  return angle * angle / 6;
}

bool water_built() { return true; }

std::unique_ptr<PoreWater> make_pore_water(const Water& water, const dem::Scene& scene,
                                           const dem::State& grains, const WaterState& before, bool restart) {
  return std::make_unique<GridWater>(water, scene, grains, before, restart);
}

}  // namespace moraine::coupling
