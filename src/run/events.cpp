#include "run/events.hpp"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>

#include "case/keys.hpp"
#include "case/read.hpp"
#include "error.hpp"

namespace moraine::run {

namespace {

using dem::BodyId;

constexpr const char* header = "stage,step,key,value";

std::string number(double value) { return cases::to_toml(value); }

// The load's drive and history, and the member of the drive that holds its value; or its side of the water.
struct Target {
  dem::Drive* drive = nullptr;
  double dem::Drive::*value = nullptr;
  History* history = nullptr;
  fluid::Side* side = nullptr;
};

// Throws Error where the load does not drive the stage.
Target target_of(Stage& stage, const std::string& key) {
  using Kind = dem::Drive::Kind;
  dem::Drive &wall = stage.scene.body(BodyId::top_wall).z, &layer = stage.scene.body(BodyId::top_layer).x;
  const auto expect = [&](bool right, const std::string& what) {
    if (!right) throw error(key, ": does not drive stage ", stage.name, ", ", what);
  };
  if (key == "normal_stress") {
    expect(stage.scene.has(BodyId::top_wall) && wall.kind == Kind::stress,
           "which has no top wall under a stress; expected a stage that has one (consolidate, shear, "
           "shear_stress)");
    return {&wall, &dem::Drive::mean, &stage.histories.normal_stress};
  }
  if (key == "shear_stress") {
    expect(layer.kind == Kind::stress, "whose top layer no stress drives; expected kind = \"shear_stress\"");
    return {&layer, &dem::Drive::mean, &stage.histories.shear_stress};
  }
  if (key == "velocity") {
    expect(layer.kind == Kind::velocity, "whose top layer has no velocity given; expected kind = \"shear\"");
    return {&layer, &dem::Drive::velocity, &stage.histories.velocity};
  }
  expect(stage.water.present, "which is dry; expected fluid = true");
  if (key == "top_pressure") {
    expect(stage.water.top == coupling::TopSide::drained,
           "whose top is impermeable; expected fluid_top = \"drained\"");
    return {.side = &stage.water.sides.high[2]};
  }
  expect(stage.water.sides.low[2].kind == fluid::Side::Kind::pressure,
         "whose bottom is not at a pressure; expected fluid_bottom = \"pressure\"");
  return {.side = &stage.water.sides.low[2]};
}

}  // namespace

const std::vector<std::string>& loads_from_outside() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const cases::Key& key : cases::keys())
      if (key.type == cases::Key::Type::load) list.push_back(key.name.substr(key.table().size()));
    return list;
  }();
  return names;
}

double load_value(const std::string& key, const std::string& value) {
  const auto& loads = loads_from_outside();
  const std::string stated = key + " = " + value;
  if (std::ranges::find(loads, key) == loads.end()) {
    const std::string near = cases::nearest(key, loads);
    const bool known = cases::find("stage." + key) || cases::find(key);
    throw error(
        stated, known ? ": stays as it is while a stage runs; " : ": unknown load; ",
        near.empty() ? "what may change is " + cases::join(loads, ", ") : "did you mean " + near + "?");
  }
  try {
    const cases::Value parsed = cases::parse_default(*cases::find("stage." + key), value);
    if (const double* found = std::get_if<double>(&parsed)) return *found;
  } catch (const Error& e) {
    throw error(stated, ": ", e.what());
  }
  throw error(stated, ": expected a number, which counts from this step on");
}

bool has_load(const cases::Stage& asked, const Stage& stage, const std::string& key, double value) {
  Stage copy = stage;
  const Target target = target_of(copy, key);
  const History* history = target.side ? &target.side->history : target.history;
  if (history->is_there()) return history->stays && history->value == std::vector{value};
  if (key == "velocity" && asked.duration <= 0)
    throw error("velocity: how long stage ", stage.name,
                " lasts follows from its strain and its velocity; give it a duration to change the velocity");
  return (target.side ? target.side->value : target.drive->*target.value) == value;
}

void apply(const LoadEvent& event, Stage& stage) {
  const Target target = target_of(stage, event.key);
  (target.side ? target.side->history : *target.history) = {.between = History::Between::steps,
                                                            .stays = true,
                                                            .time = {stage.scene.time(event.step)},
                                                            .value = {event.value}};
  if (target.drive) set_pieces(stage.scene, stage.histories, event.step);
}

std::vector<LoadEvent> read_events(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return {};
  const std::string all((std::istreambuf_iterator<char>(in)), {});
  std::vector<LoadEvent> events;
  std::size_t line = 0;
  for (std::size_t begin = 0, end; (end = all.find('\n', begin)) != all.npos; begin = end + 1) {
    if (++line == 1) continue;  // the header
    const std::string words = all.substr(begin, end - begin);
    const std::vector<std::string> parts = cases::split(words, ",");
    LoadEvent event{};
    const auto read = [](const std::string& text, auto& number) {
      const auto [stop, failed] = std::from_chars(text.data(), text.data() + text.size(), number);
      return failed == std::errc{} && stop == text.data() + text.size();
    };
    const auto& loads = loads_from_outside();
    if (parts.size() != 4 || !read(parts[0], event.stage) || !read(parts[1], event.step) ||
        std::ranges::find(loads, parts[2]) == loads.end() || !read(parts[3], event.value) ||
        event.stage < 1 || event.step < 0)
      throw error(file.string(), ":", line, ": ", words, ": expected ", header,
                  ", such as 3,1200,normal_stress,4e4");
    --event.stage, event.key = parts[2];
    events.push_back(event);
  }
  return events;
}

static std::string line_of(const LoadEvent& e) {
  return text(e.stage + 1, ",", e.step, ",", e.key, ",", number(e.value), "\n");
}

void append_event(const std::filesystem::path& file, const LoadEvent& event) {
  const bool is_new = !std::filesystem::exists(file);
  std::ofstream out(file, std::ios::app | std::ios::binary);
  if (is_new) out << header << "\n";
  out << line_of(event) << std::flush;
  if (!out) throw error(file.string(), ": cannot be written");
}

void write_events(const std::filesystem::path& file, const std::vector<LoadEvent>& events) {
  std::string out = std::string(header) + "\n";
  for (const LoadEvent& e : events) out += line_of(e);
  output::write_text(file, out);
}

std::string describe(const LoadEvent& event, const std::string& stage) {
  const std::string unit = cases::find("stage." + event.key)->unit;
  return text("event: stage ", stage, ", step ", event.step, ": ", event.key, " = ", number(event.value), " ",
              unit);
}

}  // namespace moraine::run
