// What a run leaves in CASE/output. Every file appears whole (written aside, then renamed) or, for series.h5,
// grows by whole rows that a reader may follow while the run goes on (HDF5 SWMR).
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "coupling/water.hpp"
#include "dem/observe.hpp"
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::output {

// One column of series.h5. The list is the single place that names them.
struct Column {
  const char* name;
  const char* units;
  const char* meaning;
};

// One row; the order of the columns is that of the members.
struct Row {
  double stage;               // index of the stage
  double step;                // steps since the stage began
  double time;                // s, since the case began
  double stage_time;          // s, since the stage began
  double shear_strain;        // 1, displacement of the top layer since shear began, over H_0
  double shear_stress;        // Pa
  double normal_stress;       // Pa
  double shear_friction;      // 1
  double height;              // m
  double dilation;            // m, height - H_0
  double dilation_diameters;  // mean grain diameters
  double porosity;            // 1
  double mean_overlap;        // m
  double max_overlap;         // m
  double coordination;        // contacts per grain
  double unbalanced_force;    // 1
  double kinetic, rotational, elastic_normal, elastic_tangential, potential, wall_kinetic;  // J
  double slip, viscous, top_wall_work, layers_work;                                         // J
  double residue;  // J, since the stage began
  // Pore water; columns only where a stage of the case has some.
  double wall_water_pressure;                                          // Pa
  double total_friction;                                               // 1
  double water_pressure_mean, water_pressure_min, water_pressure_max;  // Pa
  double water_drained_top, water_drained_bottom;                      // m3
  double water_volume, water_balance;                                  // m3
  double water_work, water_stored, water_dissipated;                   // J
  // Of a box that is pressed; columns only where a stage of the case presses.
  double side_x, side_y, side_z;        // m
  double stress_x, stress_y, stress_z;  // Pa, of the grains on its sides
  // What is asked for; columns only where a stage of the case follows a history. 0 where nothing is.
  double asked_normal_stress, asked_shear_stress;    // Pa
  double asked_velocity;                             // m/s, of the top layer
  double asked_top_pressure, asked_bottom_pressure;  // Pa
};
const std::vector<Column>& columns();      // as many as Row has doubles, in its order
constexpr std::size_t dry_columns = 27;    // of these, the first
constexpr std::size_t side_columns = 39;   // from here those of a pressed box; in between those of water
constexpr std::size_t asked_columns = 45;  // from here what histories ask for

// series.h5: one extendible chunked dataset of doubles for each column, each with attributes `units` and
// `meaning`.
class Series {
 public:
  // Creates PATH anew holding `rows` (written aside and renamed), then opens it for appending in SWMR mode.
  Series(const std::filesystem::path& path, const std::vector<Row>& rows, bool with_water = false,
         bool with_sides = false, bool with_asked = false);
  ~Series();
  void append(const Row& row);  // flushed: a reader sees it at once
  const std::vector<Row>& rows() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Reads series.h5 back, also while another process appends (SWMR). Throws Error.
std::vector<Row> read_series(const std::filesystem::path& path);

// What a stage began with: rows of the series and snapshots count from here.
struct StageStart {
  double time = 0;        // s, since the case began
  std::int64_t step = 0;  // of the scene's clock; not 0 where the stage goes on as the one before
  double clock = 0;       // s, Scene::time(step)
  double end = 0;         // s, of that clock: where the stage is to end, between two steps
  double energy = 0;      // J
  dem::Ledger ledger;
  double drained_top = 0, drained_bottom = 0;  // m3
  double water_dissipated = 0;                 // J
};

// snapshots/NAME.h5, grains in the order of their ids, contacts with force vectors; attributes time, stage,
// step. All datasets carry `units`. NAME comes from stage and number: e.g. 02-shear-000040.h5. loads: the
// forces to write; null: those of the step alone.
struct SnapshotInfo {
  std::string file;  // name within snapshots/
  double time;       // s, since the case began
  std::int64_t grains, contacts;
  std::int64_t water_x = 0, water_y = 0, water_z = 0;  // cells of the water's grid
  dem::Vec3d water_size{0, 0, 0};                      // m, of that grid
};
SnapshotInfo write_snapshot(const std::filesystem::path& directory, const std::string& name, double time,
                            const dem::Scene& scene, const dem::State& staggered,
                            const std::optional<coupling::WaterFields>& water = {},
                            const dem::Loads* loads = nullptr, const StageStart& start = {});
// What a snapshot has to begin another case with; grains by id.
struct Snapshot {
  dem::Vec3d box;   // m
  double top_wall;  // m; 0: none
  std::vector<dem::BodyId> role;
  std::vector<dem::Material> material;  // empty: all grains are of the first
  std::vector<double> r;                // m
  std::vector<dem::Vec3d> x, v;         // m, in the box; m/s
  std::vector<dem::Vec3d> omega;        // rad/s, half a step earlier
  std::vector<dem::Vec3d> rotation;     // rad
  std::vector<dem::Index> i, j;         // of contacts, i < j
  std::vector<dem::Vec3d> f_t;          // N, on i
};
bool is_snapshot(const std::filesystem::path& path);  // as its first lines say
// Throws Error as read_checkpoint does.
Snapshot read_snapshot(const std::filesystem::path& path);
// snapshots/grains.xdmf and snapshots/contacts.xdmf: time series for ParaView (XDMF 3, Polyvertex with a
// radius; contacts as points with force vectors). With pore water also water.xdmf, the grid's cells, and
// bed.xdmf, grains and grid together. Rewritten whole; of snapshots of one time it lists the last.
void write_xdmf(const std::filesystem::path& directory, const std::vector<SnapshotInfo>& snapshots);

// A load that was changed from outside (src/run/events.hpp).
struct LoadEvent {
  std::int64_t stage, step;  // index; of the scene's clock
  std::string key;           // of a stage: "normal_stress"
  double value;              // SI, from this step on
  bool operator==(const LoadEvent&) const = default;
};

// checkpoint.h5: all that is needed to go on with the same bits, the series so far included.
struct Checkpoint {
  std::string case_text;  // resolved case
  std::string version;
  std::string materials;   // of the grains, by number: "quartz, clay"; empty: one without a name
  std::string inputs;      // files besides the case, with their digests
  std::int64_t stage = 0;  // index
  StageStart start;        // of the stage
  double height_0 = 0;     // m, H_0: of the bed when the stage, or the shear that it carries on, began
  double diameter = 0;     // m, mean of the grains, summed in memory order as it was when the stage began
  // With dt = "auto": the critical step of the contact network, s, and the step of the clock it was found at.
  double critical_step = 0;
  std::int64_t critical_at = 0;
  bool finished = false;
  dem::Scene scene;                // of the stage; dt = 0: none yet
  Histories histories;             // that its bodies follow; the scene has the present pieces
  coupling::Water water_settings;  // of the stage, as its case asks for
  dem::State state;
  coupling::WaterState water;
  std::vector<Row> rows;
  std::vector<SnapshotInfo> snapshots;
  std::vector<LoadEvent> events;  // so far
};
// What stood there before is kept as BEFORE, where that is given. Between two renames PATH is missing for a
// moment.
void write_checkpoint(const std::filesystem::path& path, const Checkpoint& checkpoint,
                      const std::filesystem::path& before = {});
// Throws Error naming the file and what is wrong: not to be opened, of another version, no state; or Damaged
// (sealed.hpp): missing, truncated, not the bytes that were written, not of this program.
Checkpoint read_checkpoint(const std::filesystem::path& path);

// Keeps other runs off a directory while this one writes there. The system lets go of it however a process
// ends.
class DirectoryLock {
 public:
  explicit DirectoryLock(const std::filesystem::path& directory);  // throws Error where another holds it
  ~DirectoryLock();
  DirectoryLock(const DirectoryLock&) = delete;
  DirectoryLock& operator=(const DirectoryLock&) = delete;

 private:
  int file_;
};

// Writes text (or any bytes) aside, waits until the disk has it, and renames it (aside.hpp). Throws Error
// (path, cause: disk full, permission), and then leaves what stood there before.
void write_text(const std::filesystem::path& path, std::string_view text);

}  // namespace moraine::output
