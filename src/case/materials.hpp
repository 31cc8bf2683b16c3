// The materials of a case: what [[material]] and [[pair]] say, and which parameters a pair has of it.
#pragma once
#include "case/read.hpp"

namespace moraine::cases {

// Into c, whose contact.* and stages are there already. Throws Error about names, rules and pairs.
void read_materials(const Draft& draft, Case& c);

// Tables of contacts and densities of a stage. Its rows of the first material have what the stage and the
// keys of [contact] and [wall] say. What a stage gives itself holds for all materials.
void set_materials(const Case& c, const Stage& stage, dem::Scene& scene);

// The number of the grains' material of this name; -1: there is none.
int material_number(const Case& c, const std::string& name);
std::vector<std::string> material_names(const Case& c);

// Which material takes a grain by its diameter and height, m. Throws Error, without saying which grain, where
// none does, or two do.
dem::Material material_of(const Case& c, double diameter, double z);

}  // namespace moraine::cases
