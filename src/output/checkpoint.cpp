// The file mirrors the structs: numbers are attributes, lists and texts are datasets, structs and lists of
// structs are groups. Units and meanings are those of scene.hpp and state.hpp.
#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "error.hpp"
#include "output/files.hpp"
#include "output/hdf5.hpp"
#include "output/sealed.hpp"

namespace moraine::output {

template <>
inline constexpr bool hdf5::all_doubles<Row> = true;

namespace {

constexpr const char* kind = "checkpoint";
constexpr std::int64_t format = 11;  // raise it with every change to a struct below

// Every member of every stored struct, once, for writing and for reading. A new member is one more line; one
// that is forgotten does not compile.
template <class T, class M>
struct Member {
  const char* name;
  M T::*pointer;
};
template <class T, class M>
Member(const char*, M T::*) -> Member<T, M>;

template <class T>
constexpr std::tuple<> members{};

template <>
constexpr std::tuple members<dem::Drive>{
    Member{"kind", &dem::Drive::kind},           Member{"velocity", &dem::Drive::velocity},
    Member{"mean", &dem::Drive::mean},           Member{"amplitude", &dem::Drive::amplitude},
    Member{"frequency", &dem::Drive::frequency}, Member{"phase", &dem::Drive::phase},
    Member{"rate", &dem::Drive::rate},           Member{"since", &dem::Drive::since},
    Member{"piecewise", &dem::Drive::piecewise}, Member{"profile", &dem::Drive::profile},
};

template <>
constexpr std::tuple members<dem::Body>{
    Member{"shape", &dem::Body::shape},   Member{"axis", &dem::Body::axis},
    Member{"facing", &dem::Body::facing}, Member{"place", &dem::Body::place},
    Member{"mass", &dem::Body::mass},     Member{"material", &dem::Body::material},
    Member{"x", &dem::Body::x},           Member{"y", &dem::Body::y},
    Member{"z", &dem::Body::z},
};

template <>
constexpr std::tuple members<dem::Scene>{
    Member{"box", &dem::Scene::box},
    Member{"periodic_x", &dem::Scene::periodic_x},
    Member{"periodic_y", &dem::Scene::periodic_y},
    Member{"periodic_z", &dem::Scene::periodic_z},
    Member{"gravity", &dem::Scene::gravity},
    Member{"down", &dem::Scene::down},
    Member{"materials", &dem::Scene::materials},
    Member{"density", &dem::Scene::density},
    Member{"least_inertia", &dem::Scene::least_inertia},
    Member{"fluid_density", &dem::Scene::fluid_density},
    Member{"exchange_interval", &dem::Scene::exchange_interval},
    Member{"dt", &dem::Scene::dt},
    Member{"time_0", &dem::Scene::time_0},
    Member{"step_0", &dem::Scene::step_0},
    Member{"contact", &dem::Scene::contact},
    Member{"bodies", &dem::Scene::bodies},
    Member{"neighbour_margin", &dem::Scene::neighbour_margin},
    Member{"ledger", &dem::Scene::ledger},
};

template <>
constexpr std::tuple members<dem::Contact>{
    Member{"i", &dem::Contact::i},
    Member{"j", &dem::Contact::j},
    Member{"spring", &dem::Contact::spring},
};

template <>
constexpr std::tuple members<dem::WallContact>{
    Member{"i", &dem::WallContact::i},
    Member{"wall", &dem::WallContact::wall},
    Member{"spring", &dem::WallContact::spring},
};

template <>
constexpr std::tuple members<dem::Ledger>{
    Member{"slip", &dem::Ledger::slip},     Member{"viscous", &dem::Ledger::viscous},
    Member{"planes", &dem::Ledger::planes}, Member{"layers", &dem::Ledger::layers},
    Member{"water", &dem::Ledger::water},
};

template <>
constexpr std::tuple members<dem::WaterReaction>{
    Member{"wall", &dem::WaterReaction::wall},
    Member{"layer", &dem::WaterReaction::layer},
    Member{"work", &dem::WaterReaction::work},
    Member{"wall_between", &dem::WaterReaction::wall_between},
};

template <>
constexpr std::tuple members<dem::BodyState>{
    Member{"x", &dem::BodyState::x},
    Member{"v", &dem::BodyState::v},
    Member{"force", &dem::BodyState::force},
};

template <>
constexpr std::tuple members<dem::State>{
    Member{"id", &dem::State::id},
    Member{"r", &dem::State::r},
    Member{"x", &dem::State::x},
    Member{"v", &dem::State::v},
    Member{"omega", &dem::State::omega},
    Member{"rotation", &dem::State::rotation},
    Member{"force", &dem::State::force},
    Member{"torque", &dem::State::torque},
    Member{"water_force", &dem::State::water_force},
    Member{"x_start", &dem::State::x_start},
    Member{"part_of", &dem::State::part_of},
    Member{"material", &dem::State::material},
    Member{"contacts", &dem::State::contacts},
    Member{"wall_contacts", &dem::State::wall_contacts},
    Member{"bodies", &dem::State::bodies},
    Member{"water", &dem::State::water},
    Member{"ledger", &dem::State::ledger},
    Member{"step", &dem::State::step},
    Member{"staggered", &dem::State::staggered},
};

template <>
constexpr std::tuple members<SnapshotInfo>{
    Member{"file", &SnapshotInfo::file},       Member{"time", &SnapshotInfo::time},
    Member{"grains", &SnapshotInfo::grains},   Member{"contacts", &SnapshotInfo::contacts},
    Member{"water_x", &SnapshotInfo::water_x}, Member{"water_y", &SnapshotInfo::water_y},
    Member{"water_z", &SnapshotInfo::water_z}, Member{"water_size", &SnapshotInfo::water_size},
};

template <>
constexpr std::tuple members<History>{
    Member{"between", &History::between},
    Member{"stays", &History::stays},
    Member{"time", &History::time},
    Member{"value", &History::value},
};

template <>
constexpr std::tuple members<Histories>{
    Member{"normal_stress", &Histories::normal_stress},
    Member{"shear_stress", &Histories::shear_stress},
    Member{"velocity", &Histories::velocity},
};

template <>
constexpr std::tuple members<fluid::Side>{
    Member{"kind", &fluid::Side::kind},           Member{"value", &fluid::Side::value},
    Member{"amplitude", &fluid::Side::amplitude}, Member{"frequency", &fluid::Side::frequency},
    Member{"phase", &fluid::Side::phase},         Member{"history", &fluid::Side::history},
};

template <>
constexpr std::tuple members<fluid::Sides>{
    Member{"low", &fluid::Sides::low},
    Member{"high", &fluid::Sides::high},
};

template <>
constexpr std::tuple members<coupling::Water>{
    Member{"present", &coupling::Water::present},
    Member{"viscosity", &coupling::Water::viscosity},
    Member{"compressibility", &coupling::Water::compressibility},
    Member{"k_c", &coupling::Water::k_c},
    Member{"porosity_range", &coupling::Water::porosity_range},
    Member{"cells", &coupling::Water::cells},
    Member{"height", &coupling::Water::height},
    Member{"sides", &coupling::Water::sides},
    Member{"top", &coupling::Water::top},
    Member{"closure", &coupling::Water::closure},
    Member{"interval", &coupling::Water::interval},
    Member{"solver", &coupling::Water::solver},
    Member{"tolerance", &coupling::Water::tolerance},
};

template <>
constexpr std::tuple members<coupling::WaterState>{
    Member{"cells", &coupling::WaterState::cells},
    Member{"q", &coupling::WaterState::q},
    Member{"p", &coupling::WaterState::p},
    Member{"x_map", &coupling::WaterState::x_map},
    Member{"height_map", &coupling::WaterState::height_map},
    Member{"moved", &coupling::WaterState::moved},
    Member{"wall_z", &coupling::WaterState::wall_z},
    Member{"wall_pressure", &coupling::WaterState::wall_pressure},
    Member{"exchanges", &coupling::WaterState::exchanges},
    Member{"drained_top", &coupling::WaterState::drained_top},
    Member{"drained_bottom", &coupling::WaterState::drained_bottom},
    Member{"drained_sides", &coupling::WaterState::drained_sides},
    Member{"dissipated", &coupling::WaterState::dissipated},
    Member{"dissipation", &coupling::WaterState::dissipation},
    Member{"volume_0", &coupling::WaterState::volume_0},
};

template <>
constexpr std::tuple members<LoadEvent>{
    Member{"stage", &LoadEvent::stage},
    Member{"step", &LoadEvent::step},
    Member{"key", &LoadEvent::key},
    Member{"value", &LoadEvent::value},
};

template <>
constexpr std::tuple members<StageStart>{
    Member{"time", &StageStart::time},
    Member{"step", &StageStart::step},
    Member{"clock", &StageStart::clock},
    Member{"end", &StageStart::end},
    Member{"energy", &StageStart::energy},
    Member{"ledger", &StageStart::ledger},
    Member{"drained_top", &StageStart::drained_top},
    Member{"drained_bottom", &StageStart::drained_bottom},
    Member{"water_dissipated", &StageStart::water_dissipated},
};

template <>
constexpr std::tuple members<Checkpoint>{
    Member{"case_text", &Checkpoint::case_text},
    Member{"version", &Checkpoint::version},
    Member{"materials", &Checkpoint::materials},
    Member{"inputs", &Checkpoint::inputs},
    Member{"stage", &Checkpoint::stage},
    Member{"start", &Checkpoint::start},
    Member{"height_0", &Checkpoint::height_0},
    Member{"diameter", &Checkpoint::diameter},
    Member{"critical_step", &Checkpoint::critical_step},
    Member{"critical_at", &Checkpoint::critical_at},
    Member{"finished", &Checkpoint::finished},
    Member{"scene", &Checkpoint::scene},
    Member{"histories", &Checkpoint::histories},
    Member{"water_settings", &Checkpoint::water_settings},
    Member{"state", &Checkpoint::state},
    Member{"water", &Checkpoint::water},
    Member{"rows", &Checkpoint::rows},
    Member{"snapshots", &Checkpoint::snapshots},
    Member{"events", &Checkpoint::events},
};

// The largest value of an enumeration; those stored start from 0.
template <class E>
constexpr E last = E{};
template <>
constexpr auto last<dem::BodyId> = dem::BodyId::y_high;
static_assert(static_cast<int>(last<dem::BodyId>) + 1 == dem::body_ids);
template <>
constexpr auto last<dem::Body::Shape> = dem::Body::Shape::layer;
template <>
constexpr auto last<dem::Drive::Kind> = dem::Drive::Kind::free;
template <>
constexpr auto last<dem::Profile> = dem::Profile::half;
template <>
constexpr auto last<History::Between> = History::Between::steps;
template <>
constexpr auto last<dem::Material> = dem::Material::wall;
static_assert(static_cast<int>(last<dem::Material>) + 1 == dem::materials);
template <>
constexpr auto last<fluid::Side::Kind> = fluid::Side::Kind::flux;
template <>
constexpr auto last<coupling::TopSide> = coupling::TopSide::impermeable;
template <>
constexpr auto last<coupling::Closure> = coupling::Closure::pressure_gradient;
template <>
constexpr auto last<coupling::Solver> = coupling::Solver::cholmod;

template <class T>
constexpr bool is_list = false;
template <class T>
constexpr bool is_list<std::vector<T>> = true;
template <class T>
constexpr bool is_array = false;
template <class T, std::size_t n>
constexpr bool is_array<std::array<T, n>> = true;

// Counts the members of an aggregate by how many initialisers it takes.
struct Anything {
  template <class T>
  operator T() const;
};
template <class T, class... Given>
constexpr std::size_t member_count() {
  if constexpr (requires { T{Given{}..., Anything{}}; }) {
    return member_count<T, Given..., Anything>();
  } else {
    return sizeof...(Given);
  }
}

// Parameters of contacts and what contacts remember list themselves (law/part.hpp): a new part needs nothing
// here.
template <class T>
concept ListsItself = requires {
  T::list();
};

template <class T>
constexpr bool is_stored_struct = [] {
  if constexpr (ListsItself<T>) {
    constexpr std::size_t described = std::apply(
        [](const auto&... named) { return (std::size_t{0} + ... + sizeof(std::declval<T>().*named.member)); },
        T::list());
    static_assert(sizeof(T) == described, "a member is missing from its part's list");
    return true;
  } else {
    constexpr std::size_t described = std::tuple_size_v<std::remove_cvref_t<decltype(members<T>)>>;
    if constexpr (described > 0)
      static_assert(described == member_count<T>(), "a member is missing from the list");
    return described > 0;
  }
}();

template <class T, class F>
void for_each_member(F f) {
  if constexpr (ListsItself<T>)
    std::apply([&](const auto&... parameter) { (f(parameter.name, parameter.member), ...); }, T::list());
  else
    std::apply([&](const auto&... member) { (f(member.name, member.pointer), ...); }, members<T>);
}

template <class T>
void put_list(const hdf5::Group& group, const char* name, const std::vector<T>& list);

// A list whose k-th entry is at(k), as a column, or a group of them.
template <class T, class At>
void put_rows(const hdf5::Group& group, const char* name, std::size_t count, At&& at) {
  if constexpr (is_stored_struct<T>) {
    const hdf5::Group inner = group.create_group(name);
    for_each_member<T>([&](const char* member, auto pointer) {
      using M = std::decay_t<decltype(std::declval<T>().*pointer)>;
      put_rows<M>(inner, member, count, [&](std::size_t k) -> const M& { return at(k).*pointer; });
    });
  } else if constexpr (is_list<T>) {  // one after the other, and how long each is
    const hdf5::Group inner = group.create_group(name);
    std::vector<std::int64_t> lengths;
    T all;
    for (std::size_t k = 0; k < count; ++k) {
      const T& one = at(k);
      lengths.push_back(static_cast<std::int64_t>(one.size()));
      all.insert(all.end(), one.begin(), one.end());
    }
    inner.write("lengths", lengths);
    put_list(inner, "all", all);
  } else if constexpr (std::same_as<T, bool>) {
    group.write_rows<std::uint8_t>(name, count, at);
  } else if constexpr (std::same_as<T, std::string>) {
    std::vector<std::string> texts;
    for (std::size_t k = 0; k < count; ++k) texts.push_back(at(k));
    group.write(name, texts);
  } else {
    group.write_rows<T>(name, count, at);
  }
}

template <class T>
void put_list(const hdf5::Group& group, const char* name, const std::vector<T>& list) {
  put_rows<T>(group, name, list.size(), [&](std::size_t k) -> decltype(auto) { return list[k]; });
}

template <class T>
void put(const hdf5::Group& group, const char* name, const T& value) {
  if constexpr (is_list<T>) {
    put_list(group, name, value);
  } else if constexpr (is_array<T>) {
    put_list(group, name, std::vector(value.begin(), value.end()));
  } else if constexpr (is_stored_struct<T>) {
    const hdf5::Group inner = group.create_group(name);
    for_each_member<T>([&](const char* member, auto pointer) { put(inner, member, value.*pointer); });
  } else if constexpr (std::same_as<T, bool>) {
    group.set(name, std::uint8_t{value});
  } else if constexpr (std::same_as<T, std::string>) {
    group.write(name, value);
  } else {
    group.set(name, value);
  }
}

template <class T>
void check_enumeration(const hdf5::Group& group, const char* name, const T& value) {
  if constexpr (std::is_enum_v<T>) {
    if (value >= T{} && value <= last<T>) return;
    throw error(group.where(name), ": ", static_cast<long>(value), " is not a value from 0 to ",
                static_cast<long>(last<T>));
  }
}

template <class T>
void get_list(const hdf5::Group& group, const char* name, std::vector<T>& list);

// What put_rows wrote, to at(k); before that begin(group, name, count), of each column.
template <class T, class Begin, class At>
void get_rows(const hdf5::Group& group, const char* name, Begin&& begin, At&& at) {
  const auto begin_here = [&](std::size_t count) { begin(group, name, count); };
  if constexpr (is_stored_struct<T>) {
    const hdf5::Group inner = group.open_group(name);
    for_each_member<T>([&](const char* member, auto pointer) {
      using M = std::decay_t<decltype(std::declval<T>().*pointer)>;
      get_rows<M>(inner, member, begin, [&](std::size_t k) -> M& { return at(k).*pointer; });
    });
  } else if constexpr (is_list<T>) {
    const hdf5::Group inner = group.open_group(name);
    std::vector<std::int64_t> lengths;
    T all;
    inner.read("lengths", lengths), get_list(inner, "all", all);
    begin_here(lengths.size());
    std::size_t from = 0;
    for (std::size_t k = 0; k < lengths.size(); ++k) {
      const std::int64_t length = lengths[k];
      if (length < 0 || static_cast<std::size_t>(length) > all.size() - from)
        throw error(inner.where("lengths"), ": ", length, " of ", all.size() - from,
                    " numbers that are left");
      const auto first = all.begin() + static_cast<std::ptrdiff_t>(from);
      at(k).assign(first, first + static_cast<std::ptrdiff_t>(length));
      from += static_cast<std::size_t>(length);
    }
  } else if constexpr (std::same_as<T, std::string>) {
    std::vector<std::string> texts;
    group.read(name, texts);
    begin_here(texts.size());
    for (std::size_t k = 0; k < texts.size(); ++k) at(k) = std::move(texts[k]);
  } else if constexpr (std::same_as<T, bool>) {
    group.read_rows<std::uint8_t>(name, begin_here, [&](std::size_t k, std::uint8_t v) { at(k) = v != 0; });
  } else {
    group.read_rows<T>(name, begin_here, [&](std::size_t k, const T& value) {
      check_enumeration(group, name, value);
      at(k) = value;
    });
  }
}

template <class T>
void get_list(const hdf5::Group& group, const char* name, std::vector<T>& list) {
  bool first = true;
  const auto begin = [&](const hdf5::Group& in, const char* column, std::size_t count) {
    if (std::exchange(first, false)) list.resize(count);
    if (count != list.size())
      throw error(in.where(column), ": ", count, " values, ", list.size(), " expected");
  };
  get_rows<T>(group, name, begin, [&](std::size_t k) -> decltype(auto) { return list[k]; });
}

template <class T>
void get(const hdf5::Group& group, const char* name, T& value) {
  if constexpr (is_list<T>) {
    get_list(group, name, value);
  } else if constexpr (is_array<T>) {
    std::vector<typename T::value_type> list;
    get_list(group, name, list);
    if (list.size() != value.size())
      throw error(group.where(name), ": ", list.size(), " values, ", value.size(), " expected");
    std::ranges::copy(list, value.begin());
  } else if constexpr (is_stored_struct<T>) {
    const hdf5::Group inner = group.open_group(name);
    for_each_member<T>([&](const char* member, auto pointer) { get(inner, member, value.*pointer); });
  } else if constexpr (std::same_as<T, bool>) {
    std::uint8_t number = 0;
    group.get(name, number);
    value = number != 0;
  } else if constexpr (std::same_as<T, std::string>) {
    group.read(name, value);
  } else {
    group.get(name, value);
    check_enumeration(group, name, value);
  }
}

// A file can be sound and its content still not be a scene, or a state.
void validate(const std::string& file, const dem::Scene& scene) {
  if (scene.materials < 1 || scene.materials > dem::grain_materials)
    throw error(file, ": /scene: materials is ", scene.materials, ", none of 1 to ", dem::grain_materials);
  for (int k = 0; k < dem::body_ids; ++k) {
    using Shape = dem::Body::Shape;
    const auto id = static_cast<dem::BodyId>(k);
    const dem::Body& body = scene.body(id);
    const auto fail = [&](const auto&... parts) {
      throw error(file, ": /scene: bodies: ", dem::name_of(id), parts...);
    };
    if (body.shape != Shape::absent && body.shape != shape_of(id)) fail(" has the shape of another body");
    if (body.axis < 0 || body.axis > 2) fail(" has the axis ", body.axis, ", none of 0, 1 and 2");
    if (std::abs(body.facing) != 1) fail(" faces ", body.facing, ", neither 1 nor -1");
  }
}

void validate(const std::string& file, const dem::State& state) {
  const std::size_t n = state.r.size();
  const auto fail = [&](const auto&... parts) { throw error(file, ": /state: ", parts...); };

  for_each_member<dem::State>([&](const char* name, auto pointer) {
    using List = std::decay_t<decltype(state.*pointer)>;
    if constexpr (is_list<List>) {
      const std::size_t size = (state.*pointer).size();
      const bool may_be_empty =
          std::string_view(name) == "water_force" || std::string_view(name) == "material";
      if (!is_stored_struct<typename List::value_type> && size != n && !(may_be_empty && size == 0))
        fail(name, " has ", size, " rows, r has ", n);
    }
  });

  std::vector<bool> seen(n);
  for (const dem::Index id : state.id) {
    if (id < 0 || static_cast<std::size_t>(id) >= n || seen[static_cast<std::size_t>(id)]) {
      fail("id ", id, " is out of range or given twice among ", n, " grains");
    }
    seen[static_cast<std::size_t>(id)] = true;
  }
  const auto grain = [n](dem::Index i) { return i >= 0 && static_cast<std::size_t>(i) < n; };
  for (const dem::Contact& c : state.contacts) {
    if (!grain(c.i) || !grain(c.j) || c.i >= c.j)
      fail("no contact can be between grains ", c.i, " and ", c.j);
  }
  for (const dem::WallContact& c : state.wall_contacts) {
    if (!grain(c.i)) fail("no wall contact can be of grain ", c.i);
    if (shape_of(c.wall) != dem::Body::Shape::plane)
      fail("no wall contact can be with ", dem::name_of(c.wall));
  }
  for (const dem::BodyId id : state.part_of)
    if (id != dem::BodyId::none && shape_of(id) != dem::Body::Shape::layer)
      fail("no grain can be part of ", dem::name_of(id));
  const auto pair = [](const dem::Contact& c) { return std::pair(c.i, c.j); };
  const auto wall_pair = [](const dem::WallContact& c) { return std::pair(c.wall, c.i); };
  if (!std::ranges::is_sorted(state.contacts, {}, pair)) fail("contacts are not sorted by (i, j)");
  if (!std::ranges::is_sorted(state.wall_contacts, {}, wall_pair))
    fail("wall_contacts are not sorted by (wall, i)");
}

// Of what a stage follows.
void validate(const std::string& file, const Checkpoint& c, const char* what, const History& h) {
  const bool rises = std::ranges::is_sorted(h.time, std::less_equal<>());
  if (h.time.size() == h.value.size() && rises) return;
  throw error(file, ": stage ", c.stage, ": the history of the ", what, " has ", h.value.size(),
              " values at ", h.time.size(), " times", rises ? "" : ", which do not rise");
}

void validate(const std::string& file, const Checkpoint& c) {
  validate(file, c.scene);
  validate(file, c, "normal stress", c.histories.normal_stress);
  validate(file, c, "shear stress", c.histories.shear_stress);
  validate(file, c, "velocity", c.histories.velocity);
  for (const auto* sides : {&c.water_settings.sides.low, &c.water_settings.sides.high})
    for (const fluid::Side& side : *sides) validate(file, c, "water", side.history);
  validate(file, c.state);
  for (const dem::Material m : c.state.material)
    if (static_cast<int>(m) >= c.scene.materials)
      throw error(file, ": /state: no grain can be of material ", static_cast<int>(m), " among ",
                  c.scene.materials);
  const coupling::WaterState& w = c.water;
  const std::size_t n = c.state.r.size();
  const auto fail = [&](const auto&... parts) { throw error(file, ": /water: ", parts...); };
  std::size_t cells = w.cells.size() == 3 ? 1 : 0;
  for (const std::int32_t along : w.cells) cells *= static_cast<std::size_t>(std::max(along, 0));
  if (w.q.size() != cells) fail("q has ", w.q.size(), " rows for ", cells, " cells");
  if (w.p.size() != w.q.size()) fail("p has ", w.p.size(), " rows, q has ", w.q.size());
  if (!w.x_map.empty() && w.x_map.size() != n) fail("x_map has ", w.x_map.size(), " rows for ", n, " grains");
  if (c.scene.exchange_interval <= 0) return;
  if (w.q.empty())
    fail("q is empty, though grains and water meet every ", c.scene.exchange_interval, " steps");
  if (w.x_map.empty() && n > 0) fail("x_map is empty");
  if (c.state.water_force.size() != n) fail("/state/water_force has no rows");
}

}  // namespace

void write_checkpoint(const std::filesystem::path& path, const Checkpoint& checkpoint,
                      const std::filesystem::path& before) {
  Aside place(path);
  {
    const hdf5::Lock lock;  // but not while the disk syncs: other cases have rows to append
    auto file = hdf5::File::create(place);
    for_each_member<Checkpoint>(
        [&](const char* name, auto pointer) { put(file, name, checkpoint.*pointer); });
    file.close();
  }
  seal(place, kind, format);
  place.put_in_place(before);
}

Checkpoint read_checkpoint(const std::filesystem::path& path) {
  const Sealed found = check_seal(path);
  const auto fail = [&](const auto&... parts) { throw error(path.string(), ": ", parts...); };
  // Earlier files begin with HDF5 itself; what has lost its seal says, at byte 24, that one stood before it.
  const bool without_seal = found.first.starts_with("\x89HDF") &&
                            found.first.find("stage_start_time") != found.first.npos &&
                            found.first.compare(24, 8, std::string(8, '\0')) == 0;
  if (without_seal)
    fail(
        "written by an earlier version of moraine (checkpoint format 4 or before, which has no checksum; "
        "this one reads ",
        format, "); run its case again");
  if (found.kind != kind) throw Damaged(path.string() + ": not a checkpoint of moraine, or damaged");
  if (found.format != format)
    fail("written by ", found.format > format ? "a later" : "an earlier",
         " version of moraine (checkpoint format ", found.format, "; this one reads ", format, ")",
         found.format > format ? "" : "; run its case again");
  const hdf5::Lock lock;
  const auto file = hdf5::File::open(path, H5F_ACC_RDONLY);
  Checkpoint checkpoint;
  for_each_member<Checkpoint>([&](const char* name, auto pointer) { get(file, name, checkpoint.*pointer); });
  validate(file.where(), checkpoint);
  return checkpoint;
}

}  // namespace moraine::output
