// Loads that are changed from outside while a stage runs, by a program that steps it (Runner::set). Each
// change is an event. The checkpoint has those up to it; CASE/output/events.csv has all, each from the moment
// it is made, so that a run which is cut off meets them again at their steps, and so does a replay.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "output/files.hpp"
#include "run/stages.hpp"

namespace moraine::run {

using output::LoadEvent;

// What may be changed: the keys of a stage that may be histories ("normal_stress", "velocity", ...).
const std::vector<std::string>& loads_from_outside();

// The number, in SI, of a value as a case has it ("40 kPa", "4e4"). Throws Error: no such load, a wrong unit,
// out of range, no number.
double load_value(const std::string& key, const std::string& value);

// Whether the stage has that number from here on already. Throws Error where the load does not drive it.
bool has_load(const cases::Stage& asked, const Stage& stage, const std::string& key, double value);

// From its step on the load is that value; a history that it followed ends there, a sinusoid goes on. Changes
// the stage's scene, histories and water.
void apply(const LoadEvent& event, Stage& stage);

// events.csv: a line each, "stage,step,key,value" with values in SI. The stage is counted from 1, as in the
// names of snapshots. What a kill has left of a last line does not count. Throws Error naming file and line.
std::vector<LoadEvent> read_events(const std::filesystem::path& file);
void write_events(const std::filesystem::path& file, const std::vector<LoadEvent>& events);
void append_event(const std::filesystem::path& file,
                  const LoadEvent& event);  // survives a kill of the program

std::string describe(const LoadEvent& event, const std::string& stage);  // for the log

}  // namespace moraine::run
