// Neighbour search by cells: all pairs closer than r_i + r_j + margin, as rows of neighbours for each grain.
// Written for any Space (backend/host.hpp, backend/cuda.cuh). The order of each row is fixed, so that sums
// over it are too.
#pragma once
#include "backend/host.hpp"
#include "dem/grain.hpp"
#include "dem/sums.hpp"
#include "error.hpp"

namespace moraine::dem {

struct CellGrid {
  Vec3d origin, inverse_cell;
  std::int32_t n[3];
  Sides sides;

  MORAINE_HD std::int32_t along(int axis, double x) const {
    const double side = sides.side[axis];
    if (side > 0) x -= side * ::floor(x * sides.inverse[axis]);
    const auto c = static_cast<std::int32_t>((x - origin[axis]) * inverse_cell[axis]);
    return c < 0 ? 0 : c >= n[axis] ? n[axis] - 1 : c;
  }
  MORAINE_HD std::int32_t index(const Vec3d& x) const {
    return (along(2, x.z) * n[1] + along(1, x.y)) * n[0] + along(0, x.x);
  }
  // Calls visit(first, last) for runs along x of the distinct cells that touch the one at x.
  template <class Visit>
  MORAINE_HD void runs_around(const Vec3d& x, Visit&& visit) const {
    std::int32_t low[3], count[3];
    for (int a = 0; a < 3; ++a) {
      const std::int32_t c = along(a, x[a]);
      if (sides.side[a] > 0) {
        low[a] = n[a] < 3 ? 0 : c - 1;
        count[a] = n[a] < 3 ? n[a] : 3;
      } else {
        low[a] = c > 0 ? c - 1 : 0;
        count[a] = (c + 1 < n[a] ? c + 1 : n[a] - 1) - low[a] + 1;
      }
    }
    const std::int32_t from = low[0], to = low[0] + count[0] - 1, last = n[0] - 1;
    for (std::int32_t z = 0; z < count[2]; ++z)
      for (std::int32_t y = 0; y < count[1]; ++y) {
        const std::int32_t row = (wrap(2, low[2] + z) * n[1] + wrap(1, low[1] + y)) * n[0];
        if (from < 0) visit(row + last, row + last);
        visit(row + (from < 0 ? 0 : from), row + (to > last ? last : to));
        if (to > last) visit(row, row);
      }
  }
  // Calls visit(cell) for each of them.
  template <class Visit>
  MORAINE_HD void around(const Vec3d& x, Visit&& visit) const {
    runs_around(x, [&](std::int32_t first, std::int32_t last) {
      for (std::int32_t cell = first; cell <= last; ++cell) visit(cell);
    });
  }
  MORAINE_HD std::int32_t wrap(int axis, std::int32_t c) const {
    return c < 0 ? c + n[axis] : c >= n[axis] ? c - n[axis] : c;
  }
};

namespace search {

struct Extent {  // smallest and largest coordinate in one stretch of grains
  const GrainRow* grains;
  std::int64_t n, stretch;
  double* out;
  MORAINE_HD void operator()(std::int64_t k) const {
    const std::int64_t end = (k + 1) * stretch < n ? (k + 1) * stretch : n;
    Vec3d low = grains[k * stretch].x, high = low;
    double finite = dot(low, low) - dot(low, low);  // else not a number
    for (std::int64_t i = k * stretch + 1; i < end; ++i)
      for (int a = 0; a < 3; ++a) {
        low[a] = min(low[a], grains[i].x[a]);
        high[a] = max(high[a], grains[i].x[a]);
        finite += grains[i].x[a] - grains[i].x[a];
      }
    for (int a = 0; a < 3; ++a) out[6 * k + a] = low[a] + finite, out[6 * k + 3 + a] = high[a] + finite;
  }
};

struct Key {
  CellGrid grid;
  const GrainRow* grains;
  std::int32_t *key, *value;
  MORAINE_HD void operator()(std::int64_t i) const {
    key[i] = grid.index(grains[i].x);
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
  CellGrid grid;
  const GrainRow* grains;
  const BodyId* part_of;
  const std::int32_t *order, *first, *end;
  double margin;
  std::array<bool, body_ids> rigid{};  // pairs of such grains are left out
  ContactOrder sum_order;
  std::int64_t* count;                // pass 1
  const std::int64_t* row = nullptr;  // pass 2
  Index* neighbour = nullptr;

  MORAINE_HD void operator()(std::int64_t g) const {
    const auto i = static_cast<Index>(g);
    const GrainRow& a = grains[i];
    std::int64_t found = 0;
    Index* const out = neighbour ? neighbour + row[i] : nullptr;
    grid.around(a.x, [&](std::int32_t cell) {
      for (std::int32_t k = first[cell]; k < end[cell]; ++k) {
        const Index j = order[k];
        if (j == i) continue;
        if (rigid[static_cast<int>(part_of[i])] && rigid[static_cast<int>(part_of[j])]) continue;
        const Vec3d d = nearest_image(grid.sides, a.x - grains[j].x);
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
  void build(const Space& space, const Scene& scene, const GrainRow* grains, const BodyId* part_of, Index n,
             double r_max, double margin) {
    const Cells cells = sort_into_cells(space, scene, grains, n, 2 * r_max + margin);
    count_.resize(n + 1), row.resize(n + 1);
    search::Rows rows{.grid = cells.grid,
                      .grains = grains,
                      .part_of = part_of,
                      .order = cells.order,
                      .first = cells.first,
                      .end = cells.end,
                      .margin = margin,
                      .sum_order = {chunk_size(n)},
                      .count = count_.data()};
    for (int id = 0; id < body_ids; ++id) rows.rigid[id] = scene.is_rigid(static_cast<BodyId>(id));
    space.write(count_.data() + n, std::int64_t{0});
    space.for_each(n, rows);
    space.exclusive_scan(count_.data(), row.data(), n + 1);
    total = space.read(row.data() + n);
    neighbour.resize(std::max<std::int64_t>(total, 1));
    rows.row = row.data(), rows.neighbour = neighbour.data();
    space.for_each(n, rows);
  }

  // Grains `order` by cell: those of cell c are order[first[c]] to order[end[c] - 1], by index.
  struct Cells {
    CellGrid grid;
    const std::int32_t *order, *first, *end;
  };
  // Cells at least `reach` wide; good until the next call of this or of build().
  Cells sort_into_cells(const Space& space, const Scene& scene, const GrainRow* grains, Index n,
                        double reach) {
    const CellGrid grid = make_grid(space, scene, grains, n, reach);
    const std::int32_t cells = grid.n[0] * grid.n[1] * grid.n[2];
    key_.resize(n), order_.resize(n), first_.resize(cells), end_.resize(cells);
    space.for_each(n, search::Key{grid, grains, key_.data(), order_.data()});
    space.sort_by_key(key_, order_, cells);
    space.for_each(cells, search::Clear{first_.data(), end_.data()});
    space.for_each(n, search::CellBounds{key_.data(), n, first_.data(), end_.data()});
    return {grid, order_.data(), first_.data(), end_.data()};
  }

 private:
  CellGrid make_grid(const Space& space, const Scene& scene, const GrainRow* grains, Index n, double reach) {
    const std::int64_t stretch = 256, stretches = (n + stretch - 1) / stretch;
    extent_.resize(6 * stretches);
    space.for_each(stretches, search::Extent{grains, n, stretch, extent_.data()});
    const std::vector<double> e = extent_.get();
    CellGrid grid{{0, 0, 0}, {0, 0, 0}, {1, 1, 1}, Sides::of(scene)};
    Vec3d length{};
    for (int a = 0; a < 3; ++a) {
      double low = e[a], high = e[3 + a];
      bool finite = true;
      for (std::int64_t k = 0; k < stretches; ++k) {
        low = std::min(low, e[6 * k + a]), high = std::max(high, e[6 * k + 3 + a]);
        finite = finite && std::isfinite(e[6 * k + 3 + a] - e[6 * k + a]);
      }
      if (!finite) throw error("a grain's coordinates are not finite");
      const bool periodic = grid.sides.side[a] > 0;
      grid.origin[a] = periodic ? 0 : low;
      length[a] = periodic ? grid.sides.side[a] : high - low;
    }
    // A grain that flew far off must not ask for billions of cells: at most a few for each grain.
    const double limit = 4.0 * n + 64;
    const auto cells_along = [&](int a) { return std::max(1.0, std::floor(length[a] / reach)); };
    while (cells_along(0) * cells_along(1) * cells_along(2) > limit) reach *= 1.26;
    for (int a = 0; a < 3; ++a) {
      grid.n[a] = static_cast<std::int32_t>(cells_along(a));
      grid.inverse_cell[a] = length[a] > 0 ? grid.n[a] / length[a] : 0;
    }
    return grid;
  }

  typename Space::template Array<std::int32_t> key_, order_, first_, end_;
  typename Space::template Array<std::int64_t> count_;
  typename Space::template Array<double> extent_;
};

}  // namespace moraine::dem
