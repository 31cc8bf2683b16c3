#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <numeric>
#include <sstream>

#include "error.hpp"
#include "output/files.hpp"
#include "output/hdf5.hpp"
#include "output/sealed.hpp"

namespace moraine::output {
namespace {

using dem::Index;
using dem::Vec3d;

double wrap(double x, double length) {
  const double wrapped = x - length * std::floor(x / length);
  return wrapped < length ? wrapped : 0;  // a tiny negative x rounds up to the far side
}

Vec3d wrap(const dem::Scene& scene, Vec3d x) {
  if (scene.periodic_x) x.x = wrap(x.x, scene.box.x);
  if (scene.periodic_y) x.y = wrap(x.y, scene.box.y);
  if (scene.periodic_z) x.z = wrap(x.z, scene.box.z);
  return x;
}

template <class T>
void write_column(const hdf5::Group& group, const char* name, const std::vector<std::size_t>& rows,
                  const std::vector<T>& list, const char* units) {
  group.write_rows<T>(
      name, rows.size(), [&](std::size_t k) { return list[rows[k]]; }, units);
}

void write_grains(const hdf5::Group& grains, const dem::Scene& scene, const dem::State& state,
                  const dem::Loads& loads) {
  std::vector<std::size_t> rows(state.id.size());
  std::iota(rows.begin(), rows.end(), 0);
  std::sort(rows.begin(), rows.end(), [&](auto a, auto b) { return state.id[a] < state.id[b]; });
  const auto write = [&](const char* name, const auto& list, const char* units) {
    write_column(grains, name, rows, list, units);
  };
  const auto write_each = [&](const char* name, auto&& of, const char* units) {
    grains.write_rows<Vec3d>(
        name, rows.size(), [&](std::size_t k) { return of(rows[k]); }, units);
  };

  write("id", state.id, "1");
  write("role", state.part_of, "1");
  if (!state.material.empty()) write("material", state.material, "1");
  write("radius", state.r, "m");
  write_each(
      "position", [&](std::size_t i) { return wrap(scene, state.x[i]); }, "m");
  write_each(
      "displacement", [&](std::size_t i) { return state.x[i] - state.x_start[i]; }, "m");
  write("velocity", dem::velocity(scene, state), "m/s");
  write("spin", state.omega, "rad/s");
  write("rotation", state.rotation, "rad");
  write("force", loads.force, "N");  // by contacts; without gravity
  if (!state.water_force.empty()) write("water_force", state.water_force, "N");
  write("pressure", dem::grain_pressure(state, loads), "Pa");
}

// Grains by their ids, i < j, sorted: the file does not depend on the memory order. Forces are on i.
std::int64_t write_contacts(const hdf5::Group& group, const dem::Scene& scene, const dem::State& state,
                            const std::vector<dem::ContactForce>& contacts) {
  struct Entry {
    Index i, j;          // ids
    std::size_t turned;  // 2 * its number, and 1 more where that of j comes first there
  };
  std::vector<Entry> rows;
  rows.reserve(contacts.size());
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const Index i = state.id[static_cast<std::size_t>(contacts[k].i)],
                j = state.id[static_cast<std::size_t>(contacts[k].j)];
    rows.push_back({std::min(i, j), std::max(i, j), 2 * k + (i < j ? 0 : 1)});
  }
  std::sort(rows.begin(), rows.end(),
            [](const Entry& a, const Entry& b) { return std::pair(a.i, a.j) < std::pair(b.i, b.j); });
  const auto contact = [&](std::size_t k) -> const dem::ContactForce& {
    return contacts[rows[k].turned / 2];
  };
  const auto on_i = [&](std::size_t k, const Vec3d& f) { return rows[k].turned % 2 ? -f : f; };
  const auto write = [&]<class T>(const char* name, T, auto&& of, const char* units) {
    group.write_rows<T>(name, rows.size(), of, units);
  };
  const Vec3d vector{};

  write(
      "id", Index{}, [](std::size_t k) { return static_cast<Index>(k); }, "1");
  write(
      "i", Index{}, [&](std::size_t k) { return rows[k].i; }, "1");
  write(
      "j", Index{}, [&](std::size_t k) { return rows[k].j; }, "1");
  write(
      "point", vector, [&](std::size_t k) { return wrap(scene, contact(k).point); }, "m");
  write(
      "force_normal", vector, [&](std::size_t k) { return on_i(k, contact(k).f_n); }, "N");
  write(
      "force_tangential", vector, [&](std::size_t k) { return on_i(k, contact(k).f_t); }, "N");
  write(
      "force", vector, [&](std::size_t k) { return on_i(k, contact(k).f_n) + on_i(k, contact(k).f_t); }, "N");
  write(
      "overlap", double{}, [&](std::size_t k) { return contact(k).overlap; }, "m");
  return static_cast<std::int64_t>(contacts.size());
}

// By cell, x fastest.
void write_water(const hdf5::Group& group, const coupling::WaterFields& water, SnapshotInfo& info) {
  const auto& g = water.grid;
  info.water_x = g.n[0], info.water_y = g.n[1], info.water_z = g.n[2];
  info.water_size = {g.length[0], g.length[1], g.length[2]};
  group.set("cells_x", info.water_x), group.set("cells_y", info.water_y), group.set("cells_z", info.water_z);
  group.set("size", info.water_size);
  group.write("pressure", water.pressure, "Pa");
  group.write("porosity", water.porosity, "1");
  group.write("permeability", water.permeability, "m2");
  group.write("flux", water.flux, "m/s");
}

struct Field {
  const char* name;
  const char* number;  // of XDMF: type and bytes
  int columns = 1;
  const char* missing = "0";
};
constexpr const char* real = R"(NumberType="Float" Precision="8")";
constexpr const char* integer = R"(NumberType="Int" Precision="4")";
constexpr const char* byte = R"(NumberType="UChar" Precision="1")";

struct Cloud {
  const char* group;
  Field points;
  std::vector<Field> fields;
  std::int64_t SnapshotInfo::*count;
};

const Cloud clouds[] = {
    {"grains",
     {"position", real, 3},
     {{"id", integer},
      {"role", byte},
      {"radius", real},
      {"displacement", real, 3},
      {"velocity", real, 3},
      {"spin", real, 3},
      {"rotation", real, 3},
      {"force", real, 3},
      {"pressure", real}},
     &SnapshotInfo::grains},
    {"contacts",
     {"point", real, 3},
     {{"i", integer, 1, "-1"},
      {"j", integer, 1, "-1"},
      {"force_normal", real, 3},
      {"force_tangential", real, 3},
      {"force", real, 3},
      {"overlap", real}},
     &SnapshotInfo::contacts},
};

std::string shortest(double number) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, number).ptr};
}

// One step. XDMF readers know no empty cloud: a step without contacts shows one point without force, i = j =
// -1.
void write_grid(std::ostream& text, const Cloud& cloud, const SnapshotInfo& snapshot) {
  const std::int64_t found = snapshot.*cloud.count, count = std::max<std::int64_t>(found, 1);
  const auto data = [&](const Field& field) {
    text << "<DataItem Format=\"" << (found ? "HDF" : "XML") << "\" " << field.number << " Dimensions=\""
         << count;
    if (field.columns > 1) text << ' ' << field.columns;
    text << "\">";
    if (found) {
      text << snapshot.file << ":/" << cloud.group << '/' << field.name;
    } else {
      text << (field.columns == 3 ? "0 0 0" : field.missing);
    }
    text << "</DataItem>";
  };
  text << "<Grid Name=\"" << cloud.group << "\"><Time Value=\"" << shortest(snapshot.time) << "\"/>\n";
  // The ids 0, 1, ... serve as the list of vertices, which some readers want.
  text << "<Topology TopologyType=\"Polyvertex\" NodesPerElement=\"1\" NumberOfElements=\"" << count << "\">";
  data({"id", integer});
  text << "</Topology>\n<Geometry GeometryType=\"XYZ\">";
  data(cloud.points);
  text << "</Geometry>\n";
  for (const Field& field : cloud.fields) {
    text << "<Attribute Name=\"" << field.name << "\" Center=\"Node\" AttributeType=\""
         << (field.columns == 3 ? "Vector" : "Scalar") << "\">";
    data(field);
    text << "</Attribute>\n";
  }
  text << "</Grid>\n";
}

// Readers want times that rise. Where a stage ends and the next begins there are two snapshots of one time:
// the later one is what goes on from there.
std::vector<SnapshotInfo> one_for_each_time(const std::vector<SnapshotInfo>& snapshots) {
  std::vector<SnapshotInfo> listed;
  for (const SnapshotInfo& s : snapshots) {
    if (!listed.empty() && listed.back().time >= s.time) listed.pop_back();
    listed.push_back(s);
  }
  return listed;
}

std::string xdmf(const Cloud& cloud, const std::vector<SnapshotInfo>& snapshots) {
  std::ostringstream text;
  text << "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Xdmf Version=\"3.0\">\n<Domain>\n"
       << "<Grid Name=\"" << cloud.group << "\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
  for (const SnapshotInfo& snapshot : snapshots) write_grid(text, cloud, snapshot);
  text << "</Grid>\n</Domain>\n</Xdmf>\n";
  return text.str();
}

// The cells of the water's grid; readers show nothing for a step without water.
void write_water_grid(std::ostream& text, const SnapshotInfo& s) {
  text << "<Grid Name=\"water\"><Time Value=\"" << shortest(s.time) << "\"/>\n"
       << "<Topology TopologyType=\"3DCoRectMesh\" Dimensions=\"" << s.water_z + 1 << ' ' << s.water_y + 1
       << ' ' << s.water_x + 1 << "\"/>\n<Geometry GeometryType=\"ORIGIN_DXDYDZ\">"
       << "<DataItem Format=\"XML\" " << real << " Dimensions=\"3\">0 0 0</DataItem>"
       << "<DataItem Format=\"XML\" " << real << " Dimensions=\"3\">"
       << shortest(s.water_size.z / static_cast<double>(s.water_z)) << ' '
       << shortest(s.water_size.y / static_cast<double>(s.water_y)) << ' '
       << shortest(s.water_size.x / static_cast<double>(s.water_x)) << "</DataItem></Geometry>\n";
  for (const Field& field :
       {Field{"pressure", real}, {"porosity", real}, {"permeability", real}, {"flux", real, 3}}) {
    text << "<Attribute Name=\"" << field.name << "\" Center=\"Cell\" AttributeType=\""
         << (field.columns == 3 ? "Vector" : "Scalar") << "\"><DataItem Format=\"HDF\" " << field.number
         << " Dimensions=\"" << s.water_z << ' ' << s.water_y << ' ' << s.water_x
         << (field.columns == 3 ? " 3" : "") << "\">" << s.file << ":/water/" << field.name
         << "</DataItem></Attribute>\n";
  }
  text << "</Grid>\n";
}

// Steps of a wet case: the grid alone, or (bed.xdmf) grains and grid side by side.
std::string wet_xdmf(const std::vector<SnapshotInfo>& snapshots, bool with_grains) {
  Cloud wet_grains = clouds[0];
  wet_grains.fields.push_back({"water_force", real, 3});
  std::ostringstream text;
  text << "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Xdmf Version=\"3.0\">\n<Domain>\n"
       << "<Grid Name=\"steps\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
  for (const SnapshotInfo& s : snapshots) {
    if (with_grains)
      text << "<Grid Name=\"bed\" GridType=\"Collection\" CollectionType=\"Spatial\"><Time Value=\""
           << shortest(s.time) << "\"/>\n";
    if (with_grains) write_grid(text, wet_grains, s);
    write_water_grid(text, s);
    if (with_grains) text << "</Grid>\n";
  }
  text << "</Grid>\n</Domain>\n</Xdmf>\n";
  return text.str();
}

}  // namespace

SnapshotInfo write_snapshot(const std::filesystem::path& directory, const std::string& name, double time,
                            const dem::Scene& scene, const dem::State& staggered,
                            const std::optional<coupling::WaterFields>& water, const dem::Loads* mean,
                            const StageStart& start) {
  SnapshotInfo info{name + ".h5", time, staggered.size(), 0};
  Aside place(directory / info.file);
  {
    const hdf5::Lock lock;
    auto file = hdf5::File::create(place);
    file.set("program", std::string("moraine"));
    file.set("name", name);
    file.set("time", time);
    file.set("step", staggered.step - start.step);
    file.set("stage_time", scene.time(staggered.step) - start.clock);
    file.set("box", scene.box);
    file.set("top_wall", staggered.wall_z());
    const dem::Loads of_step = mean ? dem::Loads{} : dem::loads_of(scene, staggered);
    const dem::Loads& loads = mean ? *mean : of_step;
    write_grains(file.create_group("grains"), scene, staggered, loads);
    info.contacts = write_contacts(file.create_group("contacts"), scene, staggered, loads.contacts);
    if (water) write_water(file.create_group("water"), *water, info);
    file.close();
  }
  seal(place, "snapshot", 1);
  place.put_in_place();
  return info;
}

void write_xdmf(const std::filesystem::path& directory, const std::vector<SnapshotInfo>& snapshots) {
  for (const Cloud& cloud : clouds) {
    write_text(directory / (std::string(cloud.group) + ".xdmf"), xdmf(cloud, one_for_each_time(snapshots)));
  }
  std::vector<SnapshotInfo> wet;
  std::copy_if(snapshots.begin(), snapshots.end(), std::back_inserter(wet),
               [](const SnapshotInfo& s) { return s.water_x > 0; });
  if (wet.empty()) return;
  wet = one_for_each_time(wet);
  write_text(directory / "water.xdmf", wet_xdmf(wet, false));
  write_text(directory / "bed.xdmf", wet_xdmf(wet, true));
}

}  // namespace moraine::output
