// Weights that carry motion from grains to the faces of the grid, and forces back.
//
//   U_f = sum_i b_if d_i,   f_i = sum_f b_if g_f          d_i: displacement along the face's axis, m; g_f: Pa
//   b_if = A_f V_i w_if (1 + a_f . xi_i) / W_f,   W_f = max(sum_i V_i w_if (1 + a_f . xi_i), psi_min V_cell)
//
// w_if: product of hats in all three directions about the face's centre x_f, one cell wide to either side;
// they sum to one over the faces of an axis. xi = (x_i - x_f)/h. a_f makes the weighted mean of xi vanish, so
// that U of an affine motion is A_f v(x_f): plain hats have their mean where grains happen to be, and shear
// of the bed then passes for divergence. At an open side, where all grains are on one side, only along the
// side. Where there are few grains (a solid fraction below 0.2) a_f fades away, and below psi_min forces do,
// lest a lonely grain carry a whole face.
//
// Loose grains have no weights. What the flow presses on a grain that nothing holds, its neighbours bear as
// soon as it leans on them; were it pushed alone it would fly ahead, and carry the solids' share of the flow
// with it, for the drag of the mean flow does not slow it down. Where most grains are loose (a bed that lifts
// off) they count like all others: in part once more than 0.4 of the solids about a face are loose, fully
// from 0.6 on.
//
// A grain of at least a cell's width or so (wide_from) would make more of a face than there is room for: it
// goes by its parts in the eighths of the cells it covers, exactly cut (ball.hpp), each of them with hats
// about the middle of its eighth and with the displacement of the grain. No eighth holds more than its
// volume, so nor does the space about a face.
//
// What of a grain lies beyond a side that does not hold it back counts nowhere (Outside).
//
// The weights stay as they are until grains have moved by a hundredth of a cell (PoreWater); so long the sums
// are products with a sparse matrix, by chunk of grains (grain.hpp) and within it over eight faces at a time.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "backend/number.hpp"
#include "coupling/ball.hpp"
#include "coupling/faces.hpp"
#include "coupling/hats.hpp"
#include "dem/grain.hpp"
#include "fluid/grid.hpp"

namespace moraine::coupling {

// Solids beyond the low and the high side of each axis.
struct Outside {
  std::array<std::array<double, 2>, 3> volume{};  // m3
  std::array<std::array<Index, 2>, 3> grains{};   // that are wholly there
};

// What the sides of the grid do.
struct SidesOf {
  std::array<bool, 3> open_low{}, open_high{};  // water passes; solids may be pushed there, too
  Holds holds;                                  // grains do not pass
};

class Mapping {
 public:
  static constexpr double psi_min = 0.1;
  static constexpr double loose_below = 0.1;  // of the mean stress around it a grain is loose
  static constexpr double wide_from = 0.4;    // of the least width of a cell, radius

  // squeeze: m, sum of the overlaps of each grain, by which loose ones are told.
  void build(const fluid::Grid& grid, const SidesOf& sides, const dem::GrainRow* grains,
             const std::vector<dem::Vec3d>& x, const std::vector<double>& squeeze,
             const std::vector<double>& top_layer);
  // Displacements are counted from here, memory order.
  void start_from(const std::vector<dem::Vec3d>& x);
  void start_from(Index chunk, const dem::GrainRow* grains);
  std::vector<dem::Vec3d> last() const;  // where they are counted from now

  Index chunks() const { return static_cast<Index>(chunks_.size()); }
  // Adds up a chunk's part of U: since start_from(), or at present velocities for a time dt, s. Chunks may be
  // done by different threads.
  void displace(Index chunk, const dem::GrainRow* grains);
  void displace(Index chunk, const dem::GrainRow* grains, double dt);
  // U of all chunks, in their order; and the largest displacement of any grain along an axis, m.
  double collect(Faces& u) const;
  // The forces on a chunk's grains.
  void push(Index chunk, const Faces& g, dem::WaterRow* force) const;

  // The same sums for any vectors by grain, for the analysis of stability; slow.
  void apply(const std::vector<dem::Vec3d>& d, Faces& u) const;

  // What U and g of each face are multiplied with, outside of these sums.
  const Faces& scale() const { return scale_; }
  const Faces& layer() const { return layer_; }  // m2, sum of b over the top layer, by grains' shares
  const Faces& solid_fraction() const {
    return psi_;
  }  // 1, about each face; psi_min at least where grains are
  const std::vector<double>& porosity() const { return phi_; }  // of each cell, exactly
  // m, Sauter mean diameter of what of the grains is in each cell: 6 volume over surface, where a grain's
  // surface goes with its volume. 0 where there are none.
  const std::vector<double>& sauter() const { return sauter_; }
  const Outside& outside() const { return outside_; }

 private:
  // Weights of a grain for the eight faces around it along each axis, in units of scale() and rounded to 16
  // bits: they are read twice in a step, and memory is what that takes time for. Both ways use the same ones,
  // and scale() puts their sum over a face right again, so that rigid motion and momentum are exact all the
  // same.
  struct Weights {
    std::array<std::array<std::int16_t, 8>, 3> b;
    std::array<std::uint16_t, 3> octet;  // of the chunk

    Pack of(int axis, int half) const;
  };
  // Eight faces that grains share.
  struct Octet {
    std::array<Index, 8> face;  // of the grid
    std::array<Index, 4> slot;  // of the chunk's own sums, for two faces each
  };
  using Two = std::array<double, 2>;
  // A grain's weight for one face, by the chunk's list of those, in units of scale().
  struct Share {
    Index slot;
    double b;
  };
  struct Wide {
    Index grain;
    std::array<std::array<Index, 2>, 3> shares;  // first and end, of each axis
  };
  struct alignas(64) Chunk {
    Index begin, end;                              // grains
    std::vector<Octet> octets;                     // of all axes, one after another
    std::array<Index, 4> first_octet, first_slot;  // of each axis
    std::vector<std::array<Index, 2>> face;        // of each slot: neighbours along x
    std::vector<Two> sum;
    std::vector<Wide> wide;
    std::vector<Share> share;
    std::vector<Index> wide_face;  // of all axes, one after another
    std::array<Index, 4> first_wide_face;
    std::vector<double> wide_sum;
    double moved = 0;
  };
  // A wide grain's part in an eighth of a cell.
  struct Part {
    dem::Vec3d x;  // of the eighth's centre, m
    double v;      // m3
  };
  struct WideParts {
    Index grain;
    std::size_t first, end;  // of parts_, then of spread_ for one axis
  };
  // What of a wide grain lies about a face, later its weight there.
  struct Spread {
    Index face;
    Moments m;
    double b;
  };
  void cut(const fluid::Grid& grid, const Holds& holds, const dem::GrainRow* grains,
           const std::vector<dem::Vec3d>& x);
  double clip(const fluid::Grid& grid, const Holds& holds, const dem::Vec3d& x, double r);
  void put_hats(const fluid::Grid& grid, int axis, const std::vector<dem::Vec3d>& x);
  void find_bearing(const fluid::Grid& grid, const dem::GrainRow* grains, const std::vector<double>& squeeze);
  void weigh(const fluid::Grid& grid, int axis, bool open_low, bool open_high);
  void round(int axis, const std::vector<double>& top_layer);
  void lay_out(int axis);
  void lay_out_wide(int axis);
  template <class Displacement>
  void add_up(Index chunk, double unit, Displacement&& displacement);

  std::vector<Chunk> chunks_;
  std::vector<Weights> weights_;   // memory order, as the next four
  std::vector<Stencil> stencils_;  // of cells, then of one axis after another while weights are made
  std::vector<double> volume_;     // m3, that goes by the grain's own stencil: of wide grains none
  std::vector<char> bears_;        // whether, or it is loose
  std::vector<Pack> last_;         // m
  std::vector<WideParts> wide_, spreads_;
  std::vector<Part> parts_;
  std::vector<Spread> spread_;
  BallParts ball_;
  Outside outside_;
  Faces layer_, psi_, scale_;
  std::vector<double> phi_, sauter_;
};

}  // namespace moraine::coupling
