#include "coupling/pore_water.hpp"

#include <algorithm>
#include <cmath>

#include "coupling/account.hpp"
#include "coupling/describe.hpp"
#include "coupling/readings.hpp"
#include "coupling/thrust.hpp"
#include "coupling/walls.hpp"
#include "fluid/regrid.hpp"

namespace moraine::coupling {

namespace {

using dem::Vec3d;

constexpr double map_lasts = 0.01;  // of a cell, that grains may move before the weights are made anew

fluid::SolverOptions options_of(const Water& w) {
  fluid::SolverOptions o;
  o.choice = w.solver == Solver::pcg       ? fluid::SolverChoice::pcg
             : w.solver == Solver::cholmod ? fluid::SolverChoice::cholmod
                                           : fluid::SolverChoice::automatic;
  o.tolerance = w.tolerance;
  return o;
}

// m, of the grid to begin with.
double height_of(const Water& water, const dem::Scene& scene, const dem::State& grains,
                 const WaterState& before, bool restart) {
  if (restart) return before.height_map;
  return has_wall(scene) ? grains.wall_z() : water.height;
}

class GridWater final : public PoreWater {
 public:
  GridWater(const Water& water, const dem::Scene& scene, const dem::State& s, const WaterState& before,
            bool restart)
      : water_(water),
        scene_(scene),
        sides_(sides_of(water)),
        skeleton_(water, scene, s, grid_over(water, scene, height_of(water, scene, s, before, restart))),
        step_(grid(), sides_, options_of(water)),
        u_(zeros_on_faces(grid())),
        last_thrust_(u_),
        thrust_{u_, u_},
        div_u_(grid().cells()),
        t_(scene.time(s.step)) {
    if (restart) {
      now_ = before;
      map(before.x_map, before.height_map);
      now_.moved = before.moved;
      mapping().start_from(s.x);
      press();
      stale_ = now_.moved > map_lasts * least_cell();
      under_way_ = true;
    } else {
      map(s.x, grid().length[2]);
      now_.wall_z = s.wall_z();
      begin(before);
    }
    stability_ = stability_of(skeleton_, water, step_.storage(), scene, s);
    // A restart keeps the interval that the stage began with, whatever its present contacts would allow.
    interval_ = restart && scene.exchange_interval > 0
                    ? scene.exchange_interval
                    : choose_interval(stability_, water.interval, scene.dt);
  }

  bool stale() const override { return stale_; }

  void remap(const dem::GrainRow* grains, const dem::BodyMotion& bodies) override {
    const double height = has_wall(scene_) ? wall_z(bodies) : grid().length[2];
    // The sum of the largest ways is longer than that of any grain.
    double moved = skeleton_.longest_way(now_.x_map, grains);
    if (has_wall(scene_)) moved += std::abs(height - now_.height_map);
    if (moved < 0.5 * map_lasts * least_cell()) {
      now_.moved = moved;
      return;
    }
    const std::vector<Vec3d> last = mapping().last();
    const Outside before = mapping().outside();
    std::vector<Vec3d> x(last.size());
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = grains[i].x;
    map(x, height);
    book_outside(grid(), sides_, before, mapping().outside(), now_);
    mapping().start_from(last);
  }

  void displace(dem::Index chunk, const dem::GrainRow* grains) override {
    if (interval_ > 1)
      mapping().displace(chunk, grains);
    else  // the step that led here, if one did
      mapping().displace(chunk, grains, under_way_ ? scene_.dt : 0);
  }

  dem::WaterReaction solve(const dem::BodyMotion& bodies, double t) override {
    const double moved = mapping().collect(u_);
    const double wall_dz = has_wall(scene_) ? wall_z(bodies) - now_.wall_z : 0;
    if (closed_)
      for (std::size_t f = first_at_top(); f < u_[2].size(); ++f) u_[2][f] = grid().face_area(2) * wall_dz;

    if (t > t_) flow(t, scene_.area() * wall_dz);
    t_ = t;
    std::swap(thrust_.on_solids, last_thrust_);
    const double last_wall_pressure = now_.wall_pressure;
    press();

    const double m = static_cast<double>(interval_);
    dem::WaterReaction out;
    out.work = work_on_grains();
    for (std::size_t f = 0; f < u_[0].size(); ++f)
      out.layer += mapping().layer()[0][f] * thrust_.to_push[0][f];
    out.layer *= m;
    if (has_wall(scene_)) {
      const double force = now_.wall_pressure * scene_.area();
      out.wall = closed_ ? m * force : force, out.wall_between = closed_ ? 0 : force;
      out.work += 0.5 * (last_wall_pressure + now_.wall_pressure) * scene_.area() * wall_dz;
      now_.wall_z = wall_z(bodies);
    }
    now_.moved += moved + std::abs(wall_dz);
    stale_ = now_.moved > map_lasts * least_cell();
    ++now_.exchanges;
    under_way_ = true;
    return out;
  }

  void push(dem::Index chunk, const dem::GrainRow* grains, dem::WaterRow* force) override {
    mapping().push(chunk, thrust_.to_push, force);
    if (interval_ > 1) mapping().start_from(chunk, grains);
  }

  std::int64_t interval() const override { return interval_; }
  Stability stability() const override { return stability_; }
  WaterState state() const override { return now_; }
  WaterFields fields() const override { return fields_of(skeleton_, step_, t_, now_.p); }
  WaterRecord record(bool upper_half) const override {
    return record_of(scene_, skeleton_, step_.storage(), now_, upper_half);
  }
  std::string solver() const override { return describe_solver(step_.report()); }
  std::string outside() const override {
    return describe_outside(grid(), sides_, skeleton_.mapping().outside());
  }
  std::string describe() const override { return describe_grid(water_, skeleton_, stability_, interval_); }

 private:
  const fluid::Grid& grid() const { return skeleton_.grid(); }
  Mapping& mapping() { return skeleton_.mapping(); }
  double least_cell() const { return std::min({grid().h(0), grid().h(1), grid().h(2)}); }
  std::size_t first_at_top() const { return grid().face(2, 0, 0, grid().n[2]); }  // face along z

  double top_pressure(double t) const {  // Pa, outside; of a tight top 0
    const fluid::Side& top = sides_.high[2];
    return top.kind == fluid::Side::Kind::pressure ? top.at(t) : 0;
  }

  void map(const std::vector<Vec3d>& x, double height) {
    skeleton_.make(x, height);
    step_.set(grid(), skeleton_.medium());
    now_.x_map = x, now_.height_map = height, now_.moved = 0;
  }

  // The water an earlier stage has left; on another grid its pressures; else the pressure of the top.
  void begin(const WaterState& before) {
    const std::vector<double>& storage = step_.storage();
    now_.cells.assign(grid().n.begin(), grid().n.end());
    now_.q = before.q, now_.p.resize(grid().cells());
    if (before.q.empty() || before.cells != now_.cells) {
      const std::vector<double> p =
          before.q.empty()
              ? std::vector<double>(grid().cells(), top_pressure(0))
              : fluid::regrid(before.p, {before.cells.at(0), before.cells.at(1), before.cells.at(2)},
                              grid().n);
      now_.q.resize(grid().cells());
      for (std::size_t c = 0; c < p.size(); ++c) now_.q[c] = storage[c] * p[c];
    }
    for (std::size_t c = 0; c < now_.p.size(); ++c) now_.p[c] = now_.q[c] / storage[c];
    now_.volume_0 = water_volume(scene_, skeleton_, now_);
  }

  // The step of the pressure to time t, s; wall_swept: m3, by the wall upwards.
  void flow(double t, double wall_swept) {
    divergence(grid(), u_, div_u_);
    // Not t - t_, whose last bits change from step to step: a factor of the matrix belongs to one step.
    const double dt = static_cast<double>(interval_) * scene_.dt;
    book_flow(grid(), u_, wall_swept, step_.step(t, dt, div_u_, now_.q, now_.p), now_);
    const double dissipation = step_.dissipation();
    now_.dissipated += 0.5 * dt * (now_.dissipation + dissipation);
    now_.dissipation = dissipation;
  }

  void press() {
    find_thrust(skeleton_, sides_, water_.closure, t_, now_.p, thrust_);
    if (has_wall(scene_)) now_.wall_pressure = closed_ ? mean_below_top(grid(), now_.p) : top_pressure(t_);
  }

  // J, since the last exchange.
  double work_on_grains() const {
    const auto on = [&](int axis, std::size_t f) {
      return 0.5 * (last_thrust_[axis][f] + thrust_.on_solids[axis][f]) * u_[axis][f];
    };
    double work = 0;
    for (int a = 0; a < 3; ++a)
      for (std::size_t f = 0; f < u_[a].size(); ++f) work += on(a, f);
    if (closed_)  // their displacement is the wall's
      for (std::size_t f = first_at_top(); f < u_[2].size(); ++f) work -= on(2, f);
    return work;
  }

  Water water_;
  dem::Scene scene_;
  fluid::Sides sides_;
  Skeleton skeleton_;
  fluid::PressureStep step_;
  Faces u_, last_thrust_;  // on solids, at the last exchange
  Thrust thrust_;
  std::vector<double> div_u_;
  double t_;  // s, of the last exchange
  bool closed_ = water_.top == TopSide::impermeable;
  bool stale_ = false;
  bool under_way_ = false;  // grains have moved since the weights were first made, or will have
  WaterState now_;
  Stability stability_;
  std::int64_t interval_ = 1;
};

}  // namespace

bool water_built() { return true; }

std::unique_ptr<PoreWater> make_pore_water(const Water& water, const dem::Scene& scene,
                                           const dem::State& grains, const WaterState& before, bool restart) {
  return std::make_unique<GridWater>(water, scene, grains, before, restart);
}

}  // namespace moraine::coupling
