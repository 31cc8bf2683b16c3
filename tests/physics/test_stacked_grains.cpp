// Two grains one on the other, pressed between the floor and a fixed wall: two coupled oscillators, whose
// differential equations CVODE solves at 1e-12 as the reference.
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include "backends.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

constexpr double r1 = 0.01, r2 = 0.007;

struct Stack {
  double m1, m2, g, wall_z;
  ContactParameters grain, wall;
};

// y = z1, z2, v1, v2. All three contacts stay closed.
int derivatives(double, N_Vector y_, N_Vector dy_, void* stack) {
  const Stack& s = *static_cast<Stack*>(stack);
  const double *y = N_VGetArrayPointer(y_), z1 = y[0], z2 = y[1], v1 = y[2], v2 = y[3];
  const auto push = [](const ContactParameters& p, double overlap, double closing) {
    return std::max(0.0, p.k_n * overlap + p.gamma_n * closing);
  };
  const double below = push(s.wall, r1 - z1, -v1), between = push(s.grain, r1 + r2 - (z2 - z1), v1 - v2);
  const double above = push(s.wall, z2 + r2 - s.wall_z, v2);
  double* dy = N_VGetArrayPointer(dy_);
  dy[0] = v1, dy[1] = v2, dy[2] = (below - between) / s.m1 - s.g, dy[3] = (between - above) / s.m2 - s.g;
  return 0;
}

std::vector<double> reference(Stack stack, std::vector<double> y, double end) {
  SUNContext context;
  SUNContext_Create(nullptr, &context);
  const N_Vector state = N_VMake_Serial(4, y.data(), context);
  void* cvode = CVodeCreate(CV_ADAMS, context);
  const SUNNonlinearSolver iteration = SUNNonlinSol_FixedPoint(state, 0, context);
  EXPECT_EQ(CVodeInit(cvode, derivatives, 0, state), CV_SUCCESS);
  EXPECT_EQ(CVodeSStolerances(cvode, 1e-12, 1e-16), CV_SUCCESS);
  EXPECT_EQ(CVodeSetUserData(cvode, &stack), CV_SUCCESS);
  EXPECT_EQ(CVodeSetNonlinearSolver(cvode, iteration), CV_SUCCESS);
  EXPECT_EQ(CVodeSetMaxNumSteps(cvode, 1000000), CV_SUCCESS);
  double t = 0;
  EXPECT_EQ(CVode(cvode, end, state, &t, CV_NORMAL), CV_SUCCESS);
  CVodeFree(&cvode);
  SUNNonlinSolFree(iteration);
  N_VDestroy(state);
  SUNContext_Free(&context);
  return y;
}

class StackedGrains : public OnEveryBackend {};

TEST_P(StackedGrains, MoveAsCoupledOscillators) {
  const auto engine = make();
  for (const double gamma : {0.0, 4.0}) {
    Scene s = empty_space(1e5);
    s.body(BodyId::floor) = floor_at(0), s.gravity = 9.81;
    s.with(Material::wall).k_n = 7e4;
    s.with(Material::grain).gamma_n = gamma, s.with(Material::wall).gamma_n = 0.5 * gamma;
    s.body(BodyId::top_wall) = wall_at_rest();
    const double m1 = mass(s, r1), m2 = mass(s, r2), w = std::sqrt(s.with(Material::grain).k_n / m2),
                 squeeze = 3e-4;
    State start =
        grains_at_rest({r1, r2}, {Vec3d{0, 0, r1 - squeeze}, Vec3d{0, 0, 2 * r1 + r2 - 2 * squeeze}});
    start.wall_z() = 2 * (r1 + r2) - 3 * squeeze;
    start.v[0].z = 0.1, start.v[1].z = -0.2;
    const double end = 40 / w;
    const std::vector<double> exact =
        reference({m1, m2, s.gravity, start.wall_z(), s.with(Material::grain), s.with(Material::wall)},
                  {start.x[0].z, start.x[1].z, 0.1, -0.2}, end);

    std::vector<double> z[2];
    for (const int steps : {20000, 40000}) {
      s.dt = end / steps;
      const State now = run(*engine, s, start, steps);
      ASSERT_EQ(now.contacts.size() + now.wall_contacts.size(), 3u);
      for (const int i : {0, 1}) {
        // The phase runs ahead by (w dt)^2/24 of what has passed, 40 at w dt = 2e-3.
        EXPECT_NEAR(now.x[i].z, exact[i], 40 * std::pow(w * s.dt, 2) / 24 * squeeze * 2) << "grain " << i;
        z[i].push_back(now.x[i].z);
      }
    }
    for (const int i :
         {0, 1})  // the second-order part taken away, what is left is of fourth order (third, if damped)
      EXPECT_NEAR((4 * z[i][1] - z[i][0]) / 3, exact[i], (gamma > 0 ? 1e-8 : 1e-10) * squeeze)
          << "grain " << i;
  }
}

ON_EVERY_BACKEND(StackedGrains);

}  // namespace
}  // namespace moraine::dem
