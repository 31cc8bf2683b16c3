// The grains as the water meets them: weights (mapping.hpp), porosity, permeability (Kozeny-Carman) and the
// gaps at the walls, all made anew from where grains are.
//
// Where the water states no k_c it is d^2/180 in each cell, d the Sauter mean diameter of the grains there;
// of all grains in a cell that has none. In a cell that a large grain fills the porosity that counts is
// porosity_range's least, which with so large a d would make it more permeable than what is around it: d^2
// falls towards that of all grains as (phi/phi_min)^3.
#pragma once
#include <vector>

#include "coupling/mapping.hpp"
#include "coupling/water.hpp"
#include "dem/scene.hpp"
#include "dem/state.hpp"
#include "dem/touching.hpp"
#include "fluid/step.hpp"

namespace moraine::coupling {

// The grid that the water asks for, so high, m. Throws Error where that is none, or larger than memory
// allows.
fluid::Grid grid_over(const Water& water, const dem::Scene& scene, double height);

// As the flow sees them: none through an impermeable top.
fluid::Sides sides_of(const Water& water);

class Skeleton {
 public:
  // Empty until make().
  Skeleton(const Water& water, const dem::Scene& scene, const dem::State& grains, const fluid::Grid& grid);

  // From grains at x (m, memory order) and for a grid so high (m). Displacements then count from x.
  void make(const std::vector<dem::Vec3d>& x, double height);

  const fluid::Grid& grid() const { return grid_; }
  const fluid::Medium& medium() const { return medium_; }
  const Mapping& mapping() const { return mapping_; }
  Mapping& mapping() { return mapping_; }
  const std::vector<double>& volume() const { return volume_; }  // m3, of each grain
  double solids() const { return solids_; }                      // m3, of all

  // m, the longest way along an axis from x to where grains are now; of those beyond a side at both ends
  // none.
  double longest_way(const std::vector<dem::Vec3d>& x, const dem::GrainRow* now) const;

 private:
  double k_c(std::size_t cell) const;
  bool beyond(const dem::Vec3d& x, double r) const;
  std::vector<double> squeeze(const std::vector<dem::Vec3d>& x);

  Water water_;
  dem::Scene scene_;
  fluid::Grid grid_;
  SidesOf sides_;
  std::vector<dem::GrainRow> grains_;  // where they were at make()
  std::vector<double> volume_;
  double solids_ = 0, sauter_ = 0;  // sauter: m, mean diameter
  std::vector<double> top_layer_;   // shares of its velocity, 0: of no grain of it
  dem::TouchingPairs touching_;
  Mapping mapping_;
  fluid::Medium medium_;
};

}  // namespace moraine::coupling
