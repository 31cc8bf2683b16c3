#include "run/layers.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "dem/scene.hpp"
#include "error.hpp"

namespace moraine::run {

namespace {

constexpr double least_between = 3;                             // mean diameters, or layers may meet
constexpr double usual_porosity = 0.4, loosest_porosity = 0.5;  // of a settled bed

// Three digits, for a person to read.
std::string brief(double x) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.3g", x);
  return digits;
}

struct Layers {
  double bottom, top;  // m, thickness
  bool asked_for;      // both, by the case
  std::string words;   // both, as an error names them
};

Layers layers_of(const cases::Stage& stage, const dem::State& s) {
  const double largest = 2 * *std::max_element(s.r.begin(), s.r.end());
  const auto thickness = [&](double wanted) { return wanted < 0 ? largest : wanted; };
  const auto words = [&](const char* key, double wanted) {
    return text(key, " = ", brief(thickness(wanted)), " m",
                wanted < 0 ? " (one largest diameter, by default)" : "");
  };
  return {thickness(stage.bottom_layer), thickness(stage.top_layer),
          stage.bottom_layer >= 0 && stage.top_layer >= 0,
          words("bottom_layer", stage.bottom_layer) + " and " + words("top_layer", stage.top_layer)};
}

// Thickness for both layers, m, that holds and drives some grains and leaves a third of them free; 0: none.
double layers_that_would_do(const dem::State& s, double height) {
  for (double w = height / 3; w > 0.02 * height; w -= 0.01 * height) {
    dem::Index held = 0, driven = 0;
    for (const dem::Vec3d& x : s.x) held += x.z<w, driven += x.z> height - w;
    if (held > 0 && driven > 0 && 3 * (s.size() - held - driven) >= s.size()) return w;
  }
  return 0;
}

std::string remedy(const Layers& l, const dem::State& s, double height, double thinner) {
  const double wanted = l.bottom + l.top + least_between * mean_diameter(s);
  const std::string layers =
      thinner > 0 ? text("bottom_layer and top_layer of at most ", brief(thinner), " m, or ") : "";
  return text("; expected ", layers, "a bed ", brief(wanted), " m high (some ",
              std::ceil(s.size() * wanted / height), " grains in this box, or a narrower box)",
              l.asked_for ? "" : "; with both layers given in the case they are taken as they are");
}

std::vector<std::string> warnings_of(const cases::Stage& stage, const Layers& l, const dem::State& s,
                                     double height, const std::string& bed, double thinner) {
  const double between = height - l.bottom - l.top, d = mean_diameter(s);
  if (between >= (1 - 1e-9) * least_between * d) return {};
  return {text("stage ", stage.name, ": ", l.words, " leave ", brief(std::max(between, 0.0)), " m, ",
               brief(std::max(between, 0.0) / d), " mean diameters, of ", bed,
               " to deform, and driven grains may meet held ones", remedy(l, s, height, thinner))};
}

}  // namespace

double bed_top(const dem::State& s) {
  double top = 0;
  for (dem::Index i = 0; i < s.size(); ++i) top = std::max(top, s.x[i].z + s.r[i]);
  return top;
}

double mean_diameter(const dem::State& s) {
  double sum = 0;
  for (const double r : s.r) sum += 2 * r;
  return sum / s.size();
}

std::vector<std::string> choose_layers(const cases::Stage& stage, dem::State& s) {
  const Layers l = layers_of(stage, s);
  const double height = bed_top(s);
  for (dem::Index i = 0; i < s.size(); ++i)
    s.part_of[i] = s.x[i].z < l.bottom         ? dem::BodyId::bottom_layer
                   : s.x[i].z > height - l.top ? dem::BodyId::top_layer
                                               : dem::BodyId::none;
  const auto count = [&](dem::BodyId id) { return std::count(s.part_of.begin(), s.part_of.end(), id); };
  const auto held = count(dem::BodyId::bottom_layer), driven = count(dem::BodyId::top_layer);
  const double thinner = layers_that_would_do(s, height);
  if (count(dem::BodyId::none) == 0 && !l.asked_for)
    throw error("stage ", stage.name, ": no grain is left free to deform: ", l.words, " hold ", held,
                " grains and drive ", driven, " of a bed ", brief(height), " m high",
                remedy(l, s, height, thinner));
  if (driven == 0)
    throw error("stage ", stage.name, ": no grain lies in the top layer; expected a thicker top_layer");
  return warnings_of(stage, l, s, height, text("a bed ", brief(height), " m high"), thinner);
}

std::vector<std::string> take_layers(const cases::Stage& stage, const std::vector<dem::BodyId>& roles,
                                     dem::State& s) {
  for (dem::Index i = 0; i < s.size(); ++i) s.part_of[i] = roles[s.id[i]];
  for (const dem::BodyId needed : {dem::BodyId::top_layer, dem::BodyId::none})
    if (std::ranges::find(roles, needed) == roles.end())
      throw error("stage ", stage.name, ": no grain of the start has the role ",
                  needed == dem::BodyId::none ? "free" : "top_layer", "; expected some to ",
                  needed == dem::BodyId::none ? "deform" : "be driven",
                  ", or no roles: then the layers go by height");
  std::vector<std::string> warnings;
  if (std::ranges::find(roles, dem::BodyId::bottom_layer) == roles.end())
    warnings.push_back("stage " + stage.name +
                       ": no grain of the start has the role bottom_layer: the bed may slide on the floor");
  if (stage.bottom_layer >= 0 || stage.top_layer >= 0)
    warnings.push_back(
        "stage " + stage.name +
        ": bottom_layer and top_layer do not count: the layers are the roles that the grains came with");
  return warnings;
}

std::vector<std::string> foresee_layers(const cases::Stage& stage, const dem::State& s, double area) {
  const Layers l = layers_of(stage, s);
  double volume = 0;
  for (const double r : s.r) volume += dem::sphere_volume(r);
  const double usual = volume / (1 - usual_porosity) / area, most = volume / (1 - loosest_porosity) / area;
  if (most <= l.bottom + l.top && !l.asked_for)
    throw error("stage ", stage.name, ": no grain will be left free to deform: ", s.size(),
                " grains make a bed at most ", brief(most), " m high in this box, and ", l.words,
                " take all of it", remedy(l, s, usual, 0));
  return warnings_of(stage, l, s, usual, text("a bed about ", brief(usual), " m high"), 0);
}

}  // namespace moraine::run
