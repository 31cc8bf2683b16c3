#include "run/material_of_grains.hpp"

#include <algorithm>

#include "case/keys.hpp"
#include "case/materials.hpp"
#include "error.hpp"

namespace moraine::run {

namespace {

// The case's number of each material that an earlier one had by these names.
std::vector<dem::Material> renumbered(const cases::Case& c, const std::vector<std::string>& names,
                                      const std::string& at) {
  std::vector<dem::Material> numbers;
  for (const std::string& name : names) {
    const int number = cases::material_number(c, name);
    if (number < 0)
      throw error(at, " and others may be of the materials ", cases::join(names, ", "),
                  "; expected a [[material]] of each of these names, and there is none called ", name);
    numbers.push_back(dem::Material(number));
  }
  return numbers;
}

// The scene with its materials called by other numbers.
dem::Scene with_numbers(const dem::Scene& old, const std::vector<dem::Material>& numbers,
                        std::int32_t count) {
  using dem::Material;
  dem::Scene scene = old;
  scene.materials = count;
  for (std::size_t a = 0; a < numbers.size(); ++a) {
    const auto from = static_cast<Material>(a);
    scene.density[static_cast<std::size_t>(numbers[a])] = old.density_of(from);
    scene.between(numbers[a], Material::wall) = old.between(from, Material::wall);
    for (std::size_t b = 0; b < numbers.size(); ++b)
      scene.between(numbers[a], numbers[b]) = old.between(from, static_cast<Material>(b));
  }
  return scene;
}
// One whose grains were all alike, told apart now.
void spread(dem::Scene& scene, std::int32_t count) {
  using dem::Material;
  scene.materials = count;
  scene.density.fill(scene.density[0]);
  for (int a = 0; a < count; ++a) {
    scene.between(Material(a), Material::wall) = scene.with(Material::wall);
    for (int b = 0; b < count; ++b) scene.between(Material(a), Material(b)) = scene.with(Material::grain);
  }
}

}  // namespace

void take_materials(const cases::Case& c, dem::State& s, dem::Scene& before, const std::string& names,
                    const std::function<std::string(dem::Index)>& at) {
  const auto count = static_cast<std::int32_t>(c.materials.size());
  if (!names.empty() && (count > 1 || !s.material.empty())) {
    const auto numbers = renumbered(c, cases::split(names, ", "), at(0));
    std::vector<dem::Material> material;
    for (dem::Index i = 0; i < s.size(); ++i)
      material.push_back(numbers.at(static_cast<std::size_t>(s.material_of(i))));
    s.material = std::move(material);
    before = with_numbers(before, numbers, std::max(count, 1));
  } else if (count > 1) {
    spread(before, count);
  }
  take_materials(c, s, at);
}

void take_materials(const cases::Case& c, dem::State& s, const std::function<std::string(dem::Index)>& at) {
  if (c.materials.size() < 2) return s.material.clear();
  for (dem::Index i = 0; i < static_cast<dem::Index>(s.material.size()); ++i)
    if (static_cast<std::size_t>(s.material[static_cast<std::size_t>(i)]) >= c.materials.size())
      throw error(at(i), ": is of material ", static_cast<int>(s.material[static_cast<std::size_t>(i)]) + 1,
                  ", and the case has ", c.materials.size());
  if (!s.material.empty()) return;
  for (dem::Index i = 0; i < s.size(); ++i) try {
      s.material.push_back(cases::material_of(c, 2 * s.r[i], s.x[i].z));
    } catch (const Error& e) {
      throw error(at(i), " of diameter ", 2 * s.r[i], " m at z = ", s.x[i].z, " m: ", e.what());
    }
}

}  // namespace moraine::run
