#include "coupling/ball.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dem/scene.hpp"

namespace moraine::coupling {

namespace {

using std::numbers::pi;

constexpr double unit_ball = 4 * pi / 3;

// Where X > a, Y > b and Z > c, none of them negative and the corner inside the ball. By the divergence of x:
// three times the volume is the area on the sphere less each plane's area times its distance. The area on the
// sphere is by Gauss and Bonnet: a triangle of arcs, whose circles have geodesic curvature.
double corner(double a, double b, double c) {
  const double p[3] = {a, b, c};
  double rho[3];  // radius of the circle in which each plane cuts the sphere
  for (int k = 0; k < 3; ++k) rho[k] = std::sqrt(1 - p[k] * p[k]);
  double sum = -pi;
  for (int k = 0; k < 3; ++k) {
    const double u = p[(k + 1) % 3], v = p[(k + 2) % 3], r2 = rho[k] * rho[k];
    const double along_u = std::sqrt(std::max(r2 - v * v, 0.0)),
                 along_v = std::sqrt(std::max(r2 - u * u, 0.0));
    const double arc = pi / 2 - std::atan2(u, along_v) - std::atan2(v, along_u);  // angle
    const double area = 0.5 * (r2 * arc - u * (along_v - v) - v * (along_u - u));
    const double angle = std::acos(std::min(u * v / (rho[(k + 1) % 3] * rho[(k + 2) % 3]), 1.0));
    sum += angle - p[k] * (arc + area);
  }
  return std::max(sum / 3, 0.0);
}

}  // namespace

double ball_beyond(double a) {
  if (a >= 1) return 0;
  return a <= -1 ? unit_ball : pi / 3 * (1 - a) * (1 - a) * (2 + a);
}

// A plane that misses the ball leaves fewer; one beyond the centre leaves what its mirror image takes.
double ball_beyond(double a, double b) {
  if (a >= 1 || b >= 1) return 0;
  if (a <= -1) return ball_beyond(b);
  if (b <= -1) return ball_beyond(a);
  if (a < 0) return ball_beyond(b) - ball_beyond(-a, b);
  if (b < 0) return ball_beyond(a) - ball_beyond(a, -b);
  return a * a + b * b < 1 ? 2 * corner(a, b, 0) : 0;
}

double ball_beyond(double a, double b, double c) {
  if (a >= 1 || b >= 1 || c >= 1) return 0;
  if (a <= -1) return ball_beyond(b, c);
  if (b <= -1) return ball_beyond(a, c);
  if (c <= -1) return ball_beyond(a, b);
  if (a < 0) return ball_beyond(b, c) - ball_beyond(-a, b, c);
  if (b < 0) return ball_beyond(a, c) - ball_beyond(a, -b, c);
  if (c < 0) return ball_beyond(a, b) - ball_beyond(a, b, -c);
  return a * a + b * b + c * c < 1 ? corner(a, b, c) : 0;
}

double ball_in_box(const dem::Vec3d& low, const dem::Vec3d& high) {
  double sum = 0;
  for (int e = 0; e < 8; ++e) {
    const bool x = (e & 1) != 0, y = (e & 2) != 0, z = (e & 4) != 0;
    const double v = ball_beyond(x ? high.x : low.x, y ? high.y : low.y, z ? high.z : low.z);
    sum += (x + y + z) % 2 == 0 ? v : -v;
  }
  return std::max(sum, 0.0);
}

void BallParts::cut(const fluid::Grid& grid, const Holds& holds, const dem::Vec3d& x, double r) {
  volume_ = 0, whole_ = true;
  for (int a = 0; a < 3; ++a) {
    const double h = grid.h(a), last = grid.n[a];
    double low = std::floor((x[a] - r) / h), high = std::ceil((x[a] + r) / h);  // planes around the ball
    if (!grid.periodic[a] && (low < 0 || high > last)) {
      if ((high <= 0 && !holds.low[a]) || (low >= last && !holds.high[a])) return;
      whole_ = whole_ && (low >= 0 || holds.low[a]) && (high <= last || holds.high[a]);
      low = std::clamp(low, 0.0, last - 1), high = std::clamp(high, low + 1, last);
    }
    first_[a] = static_cast<int>(low), count_[a] = static_cast<int>(high - low);
    whole_ = whole_ && count_[a] == 1;
  }
  volume_ = dem::sphere_volume(r);
  if (whole_) return;
  for (int a = 0; a < 3; ++a) {
    planes_[a].resize(count_[a] + 1);
    for (int k = 0; k <= count_[a]; ++k)
      planes_[a][k] = std::clamp(((first_[a] + k) * grid.h(a) - x[a]) / r, -1.0, 1.0);
    if (holds.low[a] && first_[a] == 0) planes_[a].front() = -1;
    if (holds.high[a] && first_[a] + count_[a] == grid.n[a]) planes_[a].back() = 1;
  }
  beyond_.clear();
  for (const double c : planes_[2])
    for (const double b : planes_[1])
      for (const double a : planes_[0]) beyond_.push_back(ball_beyond(a, b, c));
}

double BallParts::part(int i, int j, int k) const {
  const auto along_x = [&](int y, int z) { return beyond(i, y, z) - beyond(i + 1, y, z); };
  const double v = (along_x(j, k) - along_x(j + 1, k)) - (along_x(j, k + 1) - along_x(j + 1, k + 1));
  return v / unit_ball * volume_;
}

}  // namespace moraine::coupling
