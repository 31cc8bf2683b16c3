#include <gtest/gtest.h>
#include <hdf5.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <limits>

#include "output/sealed.hpp"
#include "samples.hpp"
#include "temporary_directory.hpp"

namespace moraine::output {
namespace {

Checkpoint sample(dem::Index grains) {
  RandomNumbers number;
  Checkpoint c;
  c.case_text = "title = \"Grund \xc3\xbc\"\n" + std::string(200'000, '#');
  c.version = "1.2.3";
  c.stage = 2;
  c.start.time = number(), c.start.step = 12;
  c.height_0 = -0.0, c.diameter = 1e-2 / 3;
  c.start.energy = std::numeric_limits<double>::denorm_min();
  c.finished = true;
  c.scene.box = number.vector();
  c.scene.periodic_y = false;
  c.scene.dt = 1e-7 / 3;
  c.scene.with(dem::Material::grain).mu_d = number();
  c.scene.with(dem::Material::wall).k_n = number();
  c.scene.body(dem::BodyId::top_wall) = dem::top_wall();
  c.scene.body(dem::BodyId::top_wall).z = dem::Drive::at(number());
  c.scene.body(dem::BodyId::top_layer) = dem::layer(dem::Drive::by(number()), true);
  c.scene.body(dem::BodyId::y_high) = dem::plane(1, -1, number());
  c.histories.velocity = {History::Between::steps, true, {0, 0.25, 1}, {number(), number(), number()}};
  c.water_settings.sides.high[2].history = {History::Between::linear, false, {0, 2}, {number(), -0.0}};
  c.state = random_state(number, grains);
  c.scene.exchange_interval = grains > 0 ? 4 : 0;
  for (dem::Index k = 0; k < grains; ++k) {
    c.state.water_force.push_back(number.vector());
    c.water.q.push_back(number()), c.water.p.push_back(number()), c.water.x_map.push_back(number.vector());
  }
  if (grains > 0) c.water.cells = {1, 1, grains};
  c.water.exchanges = 7;
  c.water.volume_0 = number();
  for (dem::Index k = 0; k < grains; ++k) {
    c.rows.push_back(number.row());
    c.snapshots.push_back({"02-shear-" + std::to_string(k) + ".h5", number(), grains, k});
    c.events.push_back({k % 2, 100 * k, k % 2 ? "velocity" : "normal_stress", number()});
  }
  return c;
}

class CheckpointFile : public testing::Test {
 protected:
  std::string why_not() const {
    return message([&] { read_checkpoint(path); });
  }
  // As if the file had been written with what now stands in it.
  void reseal(std::int64_t format = 11) const {
    Aside file(path);
    file.write(contents(path));
    seal(file, "checkpoint", format);
    file.put_in_place();
  }
  // Overwrites a number of the file, wherever it stands in the groups.
  template <class T>
  void change(const std::string& dataset, hid_t type, std::vector<T> values) const {
    const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t id = H5Dopen2(file, dataset.c_str(), H5P_DEFAULT);
    ASSERT_GE(H5Dwrite(id, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0);
    H5Dclose(id);
    H5Fclose(file);
    reseal();
  }

  TemporaryDirectory directory;
  std::filesystem::path path = directory.path() / "checkpoint.h5";
};

TEST_F(CheckpointFile, KeepsEveryBit) {
  for (const dem::Index grains : {0, 1, 100}) {
    const Checkpoint written = sample(grains);
    write_checkpoint(path, written);
    const Checkpoint read = read_checkpoint(path);

    EXPECT_EQ(read.case_text, written.case_text);
    EXPECT_EQ(read.state.id, written.state.id);
    EXPECT_EQ(read.state.x, written.state.x);
    EXPECT_EQ(read.state.part_of, written.state.part_of);
    EXPECT_EQ(read.state.step, written.state.step);
    EXPECT_EQ(read.state.water_force, written.state.water_force);
    EXPECT_EQ(read.water.cells, written.water.cells);
    EXPECT_EQ(read.water.q, written.water.q);
    EXPECT_EQ(read.water.x_map, written.water.x_map);
    EXPECT_EQ(read.histories, written.histories);
    EXPECT_EQ(read.water_settings, written.water_settings);
    EXPECT_TRUE(std::signbit(read.height_0));
    EXPECT_EQ(read.start.energy, written.start.energy);
    ASSERT_EQ(read.rows.size(), written.rows.size());
    EXPECT_TRUE(std::equal(read.rows.begin(), read.rows.end(), written.rows.begin(), same_bits));

    // Every other member: what was read gives the same bytes again.
    const auto again = directory.path() / "again.h5";
    write_checkpoint(again, read);
    EXPECT_EQ(contents(path), contents(again));
  }
}

TEST_F(CheckpointFile, KeepsEmptyTexts) {
  Checkpoint c = sample(2);
  c.case_text = c.version = "";
  c.snapshots[0].file = "";
  write_checkpoint(path, c);
  const Checkpoint read = read_checkpoint(path);
  EXPECT_EQ(read.case_text, "");
  EXPECT_EQ(read.snapshots[0].file, "");
}

TEST_F(CheckpointFile, RefusesWhatIsNoCheckpoint) {
  EXPECT_EQ(why_not(), path.string() + ": cannot open the file: No such file or directory");

  const std::string other = path.string() + ": not a checkpoint of moraine, or damaged";
  for (const std::string& text : {std::string(), std::string(100'000, 'x'), std::string(100'000, '\0')}) {
    directory.write("checkpoint.h5", text);
    EXPECT_EQ(why_not(), other);
  }
  { Series series(path, {}); }
  EXPECT_EQ(why_not(), other);
  const dem::State grain{.id = {0},
                         .r = {1},
                         .x = {{}},
                         .v = {{}},
                         .omega = {{}},
                         .rotation = {{}},
                         .force = {{}},
                         .torque = {{}},
                         .x_start = {{}},
                         .part_of = {dem::BodyId::none}};
  write_snapshot(directory.path(), "checkpoint", 0, {}, grain);
  EXPECT_EQ(why_not(), other);
}

// None of these may be waited for, or taken for an old state that another could replace.
TEST_F(CheckpointFile, RefusesWhatIsNoFile) {
  std::filesystem::create_directory(path);
  EXPECT_EQ(why_not(), path.string() + ": not a file but a directory");
  std::filesystem::remove(path);
  ASSERT_EQ(mkfifo(path.c_str(), 0666), 0);
  EXPECT_EQ(why_not(), path.string() + ": not a file");
  std::filesystem::remove(path);
  std::filesystem::create_symlink(path, path);
  EXPECT_EQ(why_not(), path.string() + ": cannot open the file: Too many levels of symbolic links");
}

TEST_F(CheckpointFile, RefusesOneThatWasCutShort) {
  write_checkpoint(path, sample(100));
  const std::string whole = contents(path);
  for (std::size_t size = 8; size < whole.size(); size += 997) {
    directory.write("checkpoint.h5", whole.substr(0, size));
    EXPECT_TRUE(contains(why_not(), path.string() + ": ")) << "cut at " << size;
  }
  EXPECT_TRUE(contains(why_not(), "truncated")) << why_not();
}

// A hole of a terabyte is not read.
TEST_F(CheckpointFile, RefusesAHugeFileAtOnce) {
  write_checkpoint(path, sample(2));
  ASSERT_EQ(truncate(path.c_str(), std::int64_t{1} << 40), 0);
  EXPECT_TRUE(contains(why_not(), "damaged: 1099511627776 bytes where it had ")) << why_not();
}

TEST_F(CheckpointFile, FindsEveryDamage) {
  write_checkpoint(path, sample(60));
  const std::string whole = contents(path);
  std::mt19937 random(2013);
  const auto below = [&](std::size_t n) { return random() % n; };
  for (int k = 0; k < 700; ++k) {
    std::string bytes = whole;
    const std::size_t at = below(whole.size()), length = 1 + below(5000), other = below(whole.size());
    switch (k % 7) {
      case 0:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
        break;
      case 1:
        bytes.resize(at);
        break;
      case 2:
        bytes.replace(at, length, length, '\0');
        break;
      case 3:
        bytes.replace(at, 0, whole.substr(other, length));
        break;
      case 4:
        bytes.append(whole, other, length);
        break;
      case 5:
        bytes.erase(at, length);
        break;
      case 6:
        for (std::size_t i = 0; i < 512 && at + i < bytes.size() && other + i < bytes.size(); ++i)
          std::swap(bytes[at + i], bytes[other + i]);
    }
    if (bytes == whole) continue;  // zeros where zeros were
    directory.write("checkpoint.h5", bytes);
    EXPECT_THROW(read_checkpoint(path), Damaged) << "damage " << k << " at " << at;
  }
  // Each byte of the seal itself.
  for (std::size_t at = 0; at < seal_size; ++at) {
    std::string bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ 4);
    directory.write("checkpoint.h5", bytes);
    EXPECT_THROW(read_checkpoint(path), Damaged) << "byte " << at;
  }
}

TEST_F(CheckpointFile, RefusesAnotherFormat) {
  write_checkpoint(path, sample(2));
  std::string hdf5 = contents(path).substr(seal_size);
  reseal(1000);
  EXPECT_EQ(
      why_not(),
      path.string() + ": written by a later version of moraine (checkpoint format 1000; this one reads 11)");

  directory.write("checkpoint.h5", hdf5);  // has lost its seal
  EXPECT_THROW(read_checkpoint(path), Damaged);
  hdf5[25] = 0, hdf5 += "stage_start_time";  // as formats before 5 had it
  directory.write("checkpoint.h5", hdf5);
  EXPECT_TRUE(
      contains(why_not(), path.string() + ": written by an earlier version of moraine (checkpoint format 4"))
      << why_not();
  EXPECT_TRUE(contains(why_not(), "this one reads 11")) << why_not();
}

// A checkpoint before it is no help where this version is the wrong one.
TEST_F(CheckpointFile, CallsOnlyDamageDamage) {
  write_checkpoint(path, sample(2));
  reseal(12);
  try {
    read_checkpoint(path);
    FAIL();
  } catch (const Damaged&) {
    FAIL();
  } catch (const Error&) {
  }
}

TEST_F(CheckpointFile, KeepsTheOneBefore) {
  const auto before = directory.path() / "before.h5";
  write_checkpoint(path, sample(1), before);
  EXPECT_FALSE(exists(before));
  write_checkpoint(path, sample(2), before);
  write_checkpoint(path, sample(3), before);
  EXPECT_EQ(read_checkpoint(path).state.size(), 3);
  EXPECT_EQ(read_checkpoint(before).state.size(), 2);
}

TEST_F(CheckpointFile, RefusesWhatIsNoState) {
  const auto refused = [&](const char* part) {
    return contains(why_not(), path.string() + ": /state") && contains(why_not(), part);
  };
  Checkpoint c = sample(3);

  c.state.x.pop_back();
  write_checkpoint(path, c);
  EXPECT_TRUE(refused("x has 2 rows, r has 3")) << why_not();

  write_checkpoint(path, sample(3));
  change<dem::Index>("state/id", H5T_NATIVE_INT32, {0, 1, 1});
  EXPECT_TRUE(refused("id 1 is out of range or given twice")) << why_not();

  write_checkpoint(path, sample(3));
  change<dem::Index>("state/contacts/j", H5T_NATIVE_INT32, {1, 3});
  EXPECT_TRUE(refused("between grains 1 and 3")) << why_not();

  write_checkpoint(path, sample(3));
  change<std::uint8_t>("state/part_of", H5T_NATIVE_UINT8, {0, 9, 1});
  EXPECT_TRUE(refused("/part_of: 9 is not a value from 0 to 8")) << why_not();

  write_checkpoint(path, sample(3));
  change<std::uint8_t>("state/part_of", H5T_NATIVE_UINT8, {0, 3, 1});
  EXPECT_TRUE(refused("no grain can be part of the floor")) << why_not();

  write_checkpoint(path, sample(3));
  change<std::uint8_t>("state/wall_contacts/wall", H5T_NATIVE_UINT8, {2, 3, 3, 4});
  EXPECT_TRUE(refused("no wall contact can be with the top layer")) << why_not();

  write_checkpoint(path, sample(3));
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  H5Ldelete(file, "state/torque", H5P_DEFAULT);
  H5Fclose(file);
  reseal();
  EXPECT_TRUE(refused("/torque: cannot open the dataset")) << why_not();
}

TEST_F(CheckpointFile, RefusesWhatIsNoScene) {
  const auto expect_refused = [&](auto spoil, const char* part) {
    Checkpoint c = sample(3);
    spoil(c.scene);
    write_checkpoint(path, c);
    EXPECT_TRUE(contains(why_not(), path.string() + ": /scene") && contains(why_not(), part)) << why_not();
  };
  using dem::BodyId, dem::Scene;
  const auto five = [](auto& choice) { choice = static_cast<std::decay_t<decltype(choice)>>(5); };
  expect_refused([&](Scene& s) { five(s.body(BodyId::floor).shape); },
                 "/shape: 5 is not a value from 0 to 2");
  expect_refused([&](Scene& s) { s.body(BodyId::floor).material = static_cast<dem::Material>(5); },
                 "/material: 5 is not a value from 0 to 4");
  expect_refused([&](Scene& s) { five(s.body(BodyId::floor).x.kind); },
                 "/kind: 5 is not a value from 0 to 3");
  expect_refused([](Scene& s) { s.body(BodyId::floor) = dem::layer({}, true); }, "the floor has the shape");
  expect_refused([](Scene& s) { s.body(BodyId::none) = dem::floor_at(0); }, "no body has the shape");
  expect_refused([](Scene& s) { s.body(BodyId::x_low).axis = 3; }, "the side wall x_low has the axis 3");
  expect_refused([](Scene& s) { s.body(BodyId::x_low).facing = 0; }, "the side wall x_low faces 0");
}

TEST_F(CheckpointFile, RefusesWhatIsNoHistory) {
  Checkpoint c = sample(3);
  c.histories.velocity.value.pop_back();
  write_checkpoint(path, c);
  EXPECT_TRUE(contains(why_not(), "the history of the velocity has 2 values at 3 times")) << why_not();
  c = sample(3);
  c.water_settings.sides.high[2].history.time[1] = 0;
  write_checkpoint(path, c);
  EXPECT_TRUE(contains(why_not(), "the history of the water has 2 values at 2 times, which do not rise"))
      << why_not();
}

TEST_F(CheckpointFile, RefusesWhatIsNoWater) {
  const auto expect_refused = [&](auto spoil, const char* part) {
    Checkpoint c = sample(3);
    spoil(c);
    write_checkpoint(path, c);
    EXPECT_TRUE(contains(why_not(), path.string() + ": /water: ") && contains(why_not(), part)) << why_not();
  };
  expect_refused([](Checkpoint& c) { c.water.p.pop_back(); }, "p has 2 rows, q has 3");
  expect_refused([](Checkpoint& c) { c.water.cells[0] = 2; }, "q has 3 rows for 6 cells");
  expect_refused([](Checkpoint& c) { c.water.cells.pop_back(); }, "q has 3 rows for 0 cells");
  expect_refused([](Checkpoint& c) { c.water.x_map.pop_back(); }, "x_map has 2 rows for 3 grains");
  expect_refused([](Checkpoint& c) { c.water.x_map.clear(); }, "x_map is empty");
  expect_refused([](Checkpoint& c) { c.water = {}; }, "meet every 4 steps");
  expect_refused([](Checkpoint& c) { c.state.water_force.clear(); }, "water_force has no rows");

  Checkpoint dry = sample(3);
  dry.scene.exchange_interval = 0, dry.water = {}, dry.state.water_force.clear();
  write_checkpoint(path, dry);
  EXPECT_EQ(why_not(), "");
}

TEST_F(CheckpointFile, OutlivesAKilledWriter) {
  write_checkpoint(path, sample(10));
  const std::string before = contents(path);
  const Checkpoint large = sample(5000);
  for (const int microseconds : {0, 2000, 5000, 20000, 50000}) {
    const pid_t writer = fork();
    if (writer == 0) {
      for (;;) write_checkpoint(path, large);
    }
    usleep(static_cast<useconds_t>(microseconds));
    kill(writer, SIGKILL);
    waitpid(writer, nullptr, 0);
    const dem::Index grains = read_checkpoint(path).state.size();
    EXPECT_TRUE(grains == 10 || grains == 5000);
  }
  write_checkpoint(path, sample(10));
  EXPECT_EQ(contents(path), before);
}

}  // namespace
}  // namespace moraine::output
