// Neighbour search by cells: all pairs closer than r_i + r_j + margin, as rows of neighbours for each grain.
// Grains are sorted by size into levels, each of which has a grid with cells as wide as its grains, so that
// small ones do not look through the neighbourhood of the largest. Written for any Space (backend/host.hpp,
// backend/cuda.cuh). The order of each row is fixed, so that sums over it are too.
#pragma once
#include "backend/host.hpp"
#include "dem/grain.hpp"
#include "dem/sums.hpp"
#include "error.hpp"

namespace moraine::dem {

// The cells of one level.
struct CellGrid {
  Vec3d origin, inverse_cell;
  std::int32_t n[3];
  Sides sides;
  std::int32_t before = 0;  // cells of the levels before
  double largest = 0;       // m, no radius of the level is larger

  // Number of the cell along an axis, not yet kept within the grid; x is wrapped along periodic sides.
  MORAINE_HD double steps(int axis, double x) const {
    return ::floor((x - origin[axis]) * inverse_cell[axis]);
  }
  MORAINE_HD double wrapped(int axis, double x) const {
    const double side = sides.side[axis];
    return side > 0 ? x - side * ::floor(x * sides.inverse[axis]) : x;
  }
  MORAINE_HD std::int32_t within(int axis, double c) const {
    return c < 0 ? 0 : c >= n[axis] ? n[axis] - 1 : static_cast<std::int32_t>(c);
  }
  MORAINE_HD std::int32_t along(int axis, double x) const {
    return within(axis, steps(axis, wrapped(axis, x)));
  }
  MORAINE_HD std::int32_t index(const Vec3d& x) const {
    return before + (along(2, x.z) * n[1] + along(1, x.y)) * n[0] + along(0, x.x);
  }
  // Calls visit(first, last) for runs along x of the distinct cells that a sphere about x may touch.
  template <class Visit>
  MORAINE_HD void runs_within(const Vec3d& x, double radius, Visit&& visit) const {
    const double reach = radius * (1 + 1e-9);  // whatever is rounded on the way to a cell
    std::int32_t low[3], high[3];              // high < low + n; periodic: low may be negative, high beyond n
    for (int a = 0; a < 3; ++a) {
      const double at = wrapped(a, x[a]), from = steps(a, at - reach), to = steps(a, at + reach);
      const bool periodic = sides.side[a] > 0;
      if (periodic && to - from + 1 >= n[a]) {
        low[a] = 0, high[a] = n[a] - 1;
      } else if (periodic) {
        low[a] = static_cast<std::int32_t>(from), high[a] = static_cast<std::int32_t>(to);
      } else {
        low[a] = within(a, from), high[a] = within(a, to);
      }
    }
    for (std::int32_t z = low[2]; z <= high[2]; ++z)
      for (std::int32_t y = low[1]; y <= high[1]; ++y) {
        const std::int32_t row = before + (wrap(2, z) * n[1] + wrap(1, y)) * n[0], end = n[0];
        if (low[0] < 0) visit(row + low[0] + end, row + (high[0] < 0 ? high[0] + end : end - 1));
        if (high[0] >= 0 && low[0] < end)
          visit(row + (low[0] < 0 ? 0 : low[0]), row + (high[0] < end ? high[0] : end - 1));
        if (high[0] >= end) visit(row + (low[0] < end ? 0 : low[0] - end), row + high[0] - end);
      }
  }
  MORAINE_HD std::int32_t wrap(int axis, std::int32_t c) const {
    return c < 0 ? c + n[axis] : c >= n[axis] ? c - n[axis] : c;
  }
};

// Level l has the radii from `largest` of the next, or all that are left, to its own. Fewer levels are fewer
// cells to look into, more have fewer grains in them.
constexpr double level_ratio = 2.8;
constexpr int most_levels = 10;
struct Levels {
  CellGrid grid[most_levels];
  std::int32_t count = 0;

  MORAINE_HD int of(double r) const {
    int l = 0;
    while (l + 1 < count && r <= grid[l + 1].largest) ++l;
    return l;
  }
  // Calls visit(first, last) for runs of cells, of this level and finer ones, in which a grain may be closer
  // to x than radius and margin, its own radius not counted.
  template <class Visit>
  MORAINE_HD void runs_around(const Vec3d& x, double r_and_margin, int level, Visit&& visit) const {
    for (int l = level; l < count; ++l) grid[l].runs_within(x, r_and_margin + grid[l].largest, visit);
  }
};

namespace search {

// Smallest and largest coordinates, and then radius, in one stretch of grains: eight numbers.
struct Extent {
  const GrainRow* grains;
  std::int64_t n, stretch;
  double* out;
  MORAINE_HD void operator()(std::int64_t k) const {
    const std::int64_t end = (k + 1) * stretch < n ? (k + 1) * stretch : n;
    Vec3d low = grains[k * stretch].x, high = low;
    double smallest = grains[k * stretch].r, largest = smallest;
    double finite = dot(low, low) - dot(low, low);  // else not a number
    for (std::int64_t i = k * stretch + 1; i < end; ++i) {
      for (int a = 0; a < 3; ++a) {
        low[a] = min(low[a], grains[i].x[a]);
        high[a] = max(high[a], grains[i].x[a]);
        finite += grains[i].x[a] - grains[i].x[a];
      }
      smallest = min(smallest, grains[i].r), largest = max(largest, grains[i].r);
    }
    for (int a = 0; a < 3; ++a) out[8 * k + a] = low[a] + finite, out[8 * k + 3 + a] = high[a] + finite;
    out[8 * k + 6] = smallest, out[8 * k + 7] = largest;
  }
};

struct Key {
  Levels levels;
  const GrainRow* grains;
  std::int32_t *key, *value;
  MORAINE_HD void operator()(std::int64_t i) const {
    key[i] = levels.grid[levels.of(grains[i].r)].index(grains[i].x);
    value[i] = static_cast<std::int32_t>(i);
  }
};

struct CellBounds {
  const std::int32_t* key;
  std::int64_t n;
  std::int32_t *first, *end;
  MORAINE_HD void operator()(std::int64_t k) const {
    if (k == 0 || key[k] != key[k - 1]) first[key[k]] = static_cast<std::int32_t>(k);
    if (k + 1 == n || key[k] != key[k + 1]) end[key[k]] = static_cast<std::int32_t>(k + 1);
  }
};

struct Clear {
  std::int32_t *first, *end;
  MORAINE_HD void operator()(std::int64_t k) const { first[k] = end[k] = 0; }
};

struct Rows {
  Levels levels;
  const GrainRow* grains;
  const BodyId* part_of;
  const std::int32_t *order, *first, *end;
  double margin;
  std::array<bool, body_ids> rigid{};   // pairs of such grains are left out,
  std::array<bool, body_ids> slides{};  // and those within one such body: see Scene::never_touch
  ContactOrder sum_order;
  std::int64_t* count;                // pass 1
  const std::int64_t* row = nullptr;  // pass 2
  Index* neighbour = nullptr;

  MORAINE_HD void operator()(std::int64_t g) const {
    const auto i = static_cast<Index>(g);
    const GrainRow& a = grains[i];
    std::int64_t found = 0;
    Index* const out = neighbour ? neighbour + row[i] : nullptr;
    const Sides& sides = levels.grid[0].sides;
    levels.runs_around(a.x, a.r + margin, 0, [&](std::int32_t first_cell, std::int32_t last_cell) {
      for (std::int32_t cell = first_cell; cell <= last_cell; ++cell)
        for (std::int32_t k = first[cell]; k < end[cell]; ++k) {
          const Index j = order[k];
          if (j == i) continue;
          const auto of_i = static_cast<int>(part_of[i]), of_j = static_cast<int>(part_of[j]);
          if ((rigid[of_i] && rigid[of_j]) || (of_i == of_j && slides[of_i])) continue;
          const Vec3d d = nearest_image(sides, a.x - grains[j].x);
          const double reach = a.r + grains[j].r + margin;
          if (dot(d, d) >= reach * reach) continue;
          if (out) {  // insertion keeps the row sorted
            std::int64_t at = found;
            for (; at > 0 && sum_order.before(i, j, out[at - 1]); --at) out[at] = out[at - 1];
            out[at] = j;
          }
          ++found;
        }
    });
    if (!out) count[i] = found;
  }
};

}  // namespace search

template <class Space>
struct Neighbours {
  typename Space::template Array<std::int64_t> row;  // n + 1 offsets into `neighbour`
  typename Space::template Array<Index> neighbour;
  std::int64_t total = 0;

  // Throws Error if a coordinate is not finite.
  // material: of each grain; null where all are of the first.
  void build(const Space& space, const Scene& scene, const GrainRow* grains, const BodyId* part_of, Index n,
             double margin, const Material* material = nullptr) {
    const Cells cells = sort_into_cells(space, scene, grains, n, margin);
    count_.resize(n + 1), row.resize(n + 1);
    search::Rows rows{.levels = cells.levels,
                      .grains = grains,
                      .part_of = part_of,
                      .order = cells.order,
                      .first = cells.first,
                      .end = cells.end,
                      .margin = margin,
                      .sum_order = {chunk_size(n), material},
                      .count = count_.data()};
    for (int id = 0; id < body_ids; ++id) {
      rows.rigid[id] = scene.is_rigid(static_cast<BodyId>(id));
      rows.slides[id] = scene.slides_in_itself(static_cast<BodyId>(id));
    }
    space.write(count_.data() + n, std::int64_t{0});
    space.for_each(n, rows);
    space.exclusive_scan(count_.data(), row.data(), n + 1);
    total = space.read(row.data() + n);
    neighbour.resize(total);
    if (total == 0) return neighbour.set(std::vector<Index>(1));  // never read, but copied
    rows.row = row.data(), rows.neighbour = neighbour.data();
    space.for_each(n, rows);
  }

  // Grains `order` by cell: those of cell c are order[first[c]] to order[end[c] - 1], by index.
  struct Cells {
    Levels levels;
    std::int32_t count;
    const std::int32_t *order, *first, *end;
  };
  // Cells as wide as the grains of their level and the margin; good until the next call of this or of
  // build().
  Cells sort_into_cells(const Space& space, const Scene& scene, const GrainRow* grains, Index n,
                        double margin) {
    const Levels levels = make_levels(space, scene, grains, n, margin);
    const CellGrid& last = levels.grid[levels.count - 1];
    const std::int32_t cells = last.before + last.n[0] * last.n[1] * last.n[2];
    key_.resize(n), order_.resize(n), first_.resize(cells), end_.resize(cells);
    space.for_each(n, search::Key{levels, grains, key_.data(), order_.data()});
    space.sort_by_key(key_, order_, cells);
    space.for_each(cells, search::Clear{first_.data(), end_.data()});
    space.for_each(n, search::CellBounds{key_.data(), n, first_.data(), end_.data()});
    return {levels, cells, order_.data(), first_.data(), end_.data()};
  }

 private:
  Levels make_levels(const Space& space, const Scene& scene, const GrainRow* grains, Index n, double margin) {
    const std::int64_t stretch = 256, stretches = (n + stretch - 1) / stretch;
    extent_.resize(8 * stretches);
    space.for_each(stretches, search::Extent{grains, n, stretch, extent_.data()});
    const std::vector<double> e = extent_.get();
    double smallest = e[6], largest = e[7];
    for (std::int64_t k = 0; k < stretches; ++k)
      smallest = std::min(smallest, e[8 * k + 6]), largest = std::max(largest, e[8 * k + 7]);

    Vec3d origin{}, length{};
    const Sides sides = Sides::of(scene);
    for (int a = 0; a < 3; ++a) {
      double low = e[a], high = e[3 + a];
      bool finite = true;
      for (std::int64_t k = 0; k < stretches; ++k) {
        low = std::min(low, e[8 * k + a]), high = std::max(high, e[8 * k + 3 + a]);
        finite = finite && std::isfinite(e[8 * k + 3 + a] - e[8 * k + a]);
      }
      if (!finite) throw error("a grain's coordinates are not finite");
      const bool periodic = sides.side[a] > 0;
      origin[a] = periodic ? 0 : low;
      length[a] = periodic ? sides.side[a] : high - low;
    }
    Levels levels;
    levels.count = 1;
    for (double r = largest / level_ratio; levels.count < most_levels && smallest <= r; r /= level_ratio)
      ++levels.count;
    std::int32_t before = 0;
    for (int l = 0; l < levels.count; ++l, largest /= level_ratio) {
      CellGrid& grid = levels.grid[l];
      grid = {origin, {0, 0, 0}, {1, 1, 1}, sides, before, largest};
      double width = 2 * largest + margin;
      // A grain that flew far off must not ask for billions of cells: at most a few for each grain.
      const double limit = 4.0 * n + 64;
      const auto cells_along = [&](int a) { return std::max(1.0, std::floor(length[a] / width)); };
      while (cells_along(0) * cells_along(1) * cells_along(2) > limit) width *= 1.26;
      for (int a = 0; a < 3; ++a) {
        grid.n[a] = static_cast<std::int32_t>(cells_along(a));
        grid.inverse_cell[a] = length[a] > 0 ? grid.n[a] / length[a] : 0;
      }
      before += grid.n[0] * grid.n[1] * grid.n[2];
    }
    return levels;
  }

  typename Space::template Array<std::int32_t> key_, order_, first_, end_;
  typename Space::template Array<std::int64_t> count_;
  typename Space::template Array<double> extent_;
};

}  // namespace moraine::dem
