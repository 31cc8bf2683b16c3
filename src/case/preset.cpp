#include "case/preset.hpp"

#include <algorithm>
#include <utility>

namespace moraine::cases {

namespace {

std::vector<std::pair<std::string, double>> settings(const Preset& p) {
  return {{"model.f", p.f},
          {"model.softening", p.softening},
          {"wall.gamma_n", p.wall_gamma},
          {"wall.gamma_t", p.wall_gamma}};
}

}  // namespace

const std::vector<Preset>& presets() {
  static const std::vector<Preset> list = {
      {"paper", 0.075, 1, 1e4, "the reference of the others"},
      {"standard", 0.3, 1, 2500,
       "3.9 times faster; friction, dilation, shear zone, coordination and porosity within the scatter of 8 "
       "seeds"},
      {"fast", 0.3, 30, 450,
       "19 times faster; as standard, but for the coordination, which is 0.34 contacts a grain too high"},
  };
  return list;
}

void apply_preset(Draft& draft) {
  const auto chosen = draft.entries.find("model.preset");
  if (chosen == draft.entries.end()) return;
  const std::string name = std::get<std::string>(chosen->second.value);
  const auto preset =
      std::find_if(presets().begin(), presets().end(), [&](const Preset& p) { return p.name == name; });
  if (preset == presets().end()) return;
  for (const auto& [key, value] : settings(*preset))
    draft.entries.try_emplace(key, Entry{value, key + " = " + to_toml(value) + " (by model.preset)"});
}

std::string preset_reference() {
  std::string out = "\nWhat model.preset sets, where the case does not; measured by bench/work-precision:\n";
  for (const Preset& p : presets()) {
    out += "  " + p.name + std::string(12 - p.name.size(), ' ');
    for (const auto& [key, value] : settings(p)) out += key + " = " + to_toml(value) + "  ";
    out += "(" + p.evidence + ")\n";
  }
  return out;
}

}  // namespace moraine::cases
