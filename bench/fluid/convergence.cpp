// The figures of bench/fluid-convergence, as comma-separated lines on standard output:
//   fluid_convergence errors   problem,way,against,resolution,error   (resolution: cells or steps)
//   fluid_convergence times    grid,work,diffusion_number,solver,us,iterations,first_ms
#include <chrono>
#include <cstdio>
#include <cstring>
#include <functional>
#include <random>
#include <string>

#include "fluid/known_answers.hpp"

using namespace moraine::fluid;

namespace {

void row(const char* problem, const std::string& way, const char* against, int resolution, double error) {
  std::printf("%s,%s,%s,%d,%.6g\n", problem, way.c_str(), against, resolution, error);
  std::fflush(stdout);
}

void errors() {
  std::puts("problem,way,against,resolution,error");
  for (const int n : {8, 16, 32, 64, 128}) row("Terzaghi", "evolve", "cells", n, terzaghi_error(n, {}));
  for (const int n : {20, 40, 80, 160, 320, 640, 1280})
    row("Terzaghi", "backward Euler", "steps", n, terzaghi_error(256, {n, {}}));
  for (const int n : {12, 24, 48, 96, 192})
    row("sinusoid", "evolve", "cells", n, sinusoid_error(n, {}, Sinusoid::column));
  for (const int n : {16, 32, 64, 128, 256, 512})
    row("sinusoid", "backward Euler", "steps", n, sinusoid_error(384, {n, {}}, Sinusoid::column));
  for (const int n : {4, 8, 16, 32}) row("manufactured", "evolve", "cells", n, manufactured_error(n, {}));
  for (const int n : {10, 20, 40, 80, 160, 320, 640})
    row("exact on the grid", "backward Euler", "steps", n, time_error({n, {}}));
  for (const int order : {2, 3, 4, 5})
    for (const int n : {10, 20, 40, 80, 160, 320, 640}) {
      Way way{0, {1e-12, 1e-9}};
      way.options.order = order, way.options.fixed_step = 2e-3 / n;
      row("exact on the grid", "ARKODE order " + std::to_string(order), "steps", n, time_error(way));
    }
}

double seconds(const std::function<void()>& body) {
  const auto start = std::chrono::steady_clock::now();
  body();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

struct Bed {
  Grid grid;
  Sides sides;
  Medium medium;
  std::vector<double> q, p;
  std::vector<std::vector<double>> div_u;

  explicit Bed(std::array<int, 3> n)
      : grid{n, {0.025 * n[0], 0.025 * n[1], 0.025 * n[2]}, {true, true, false}} {
    std::mt19937_64 engine(1);
    const auto random = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
    sides.high[2] = pressure_side(0);
    medium = uniform(grid, 0.4, 1e-12);
    for (double& k : medium.permeability) k *= 0.5 + random();
    for (double& phi : medium.porosity) phi += 0.1 * (random() - 0.5);
    p.assign(grid.cells(), 1e4), q = p;
    for (std::size_t c = 0; c < q.size(); ++c)
      q[c] *= medium.compressibility * medium.porosity[c] * grid.cell_volume();
    div_u.resize(16, q);  // a thousandth of what a cell holds
    for (auto& v : div_u)
      for (double& x : v) x *= 1e-3 * (random() - 0.5);
  }
  double dt(double number) const { return number * grid.h(0) * grid.h(0) / diffusivity(medium); }
};

void times() {
  std::puts("grid,work,diffusion_number,solver,us,iterations,first_ms");
  for (const std::array<int, 3> n : {std::array{8, 8, 7}, {12, 12, 24}, {20, 20, 40}, {32, 32, 64}}) {
    const std::string grid = std::to_string(n[0]) + "x" + std::to_string(n[1]) + "x" + std::to_string(n[2]);
    for (const double number : {1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0, 1e4})
      for (const SolverChoice choice : {SolverChoice::pcg, SolverChoice::cholmod}) {
        // The largest factor takes seconds, whatever the number.
        if (n[0] == 32 && choice == SolverChoice::cholmod && number != 1e-3 && number != 100) continue;
        Bed bed(n);
        PressureStep step(bed.grid, bed.sides, {choice, 1e-10, 5000});
        step.set(bed.grid, bed.medium);
        int i = 0;
        const auto one = [&] { step.step(0, bed.dt(number), bed.div_u[i++ % 16], bed.q, bed.p); };
        const double first = seconds(one);
        const auto before = step.report();
        double best = 1e9;
        std::int64_t count = 0;
        for (int round = 0; round < 25; ++round) {
          int made = 0;
          double spent = 0;
          do spent += seconds(one), ++made;
          while (spent < 0.01);
          best = std::min(best, spent / made), count += made;
        }
        const auto after = step.report();
        std::printf("%s,step,%g,\"%s\",%.4g,%.3g,%.3g\n", grid.c_str(), number, after.solver.c_str(),
                    best * 1e6, static_cast<double>(after.iterations - before.iterations) / count,
                    first * 1e3);
        std::fflush(stdout);
      }
    for (const SolverChoice choice : {SolverChoice::pcg, SolverChoice::cholmod}) {
      if (n[0] > 12) continue;
      Bed bed(n);
      EvolveOptions options{1e-5, 0.1};
      options.solver = choice;
      Evolved done;
      // Consolidation until T = 1.
      const double end = std::pow(bed.grid.length[2], 2) / diffusivity(bed.medium);
      const double spent =
          seconds([&] { done = evolve(bed.grid, bed.sides, bed.medium, 0, end, bed.q, bed.p, options); });
      std::printf("%s,evolve to T = 1,,\"%s\",%.4g,%.3g,\n", grid.c_str(), done.solver.c_str(), spent * 1e6,
                  static_cast<double>(done.iterations));
      std::fflush(stdout);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && !std::strcmp(argv[1], "errors")) {
    errors();
  } else if (argc == 2 && !std::strcmp(argv[1], "times")) {
    times();
  } else {
    std::fputs("usage: fluid_convergence errors|times\n", stderr);
    return 2;
  }
}
