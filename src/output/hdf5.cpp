#include "output/hdf5.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>

#include "error.hpp"
#include "output/sealed.hpp"

namespace moraine::output::hdf5 {
namespace {

// Before any other call: no printed error stacks (each thread has its own), and no cleaning up at exit, which
// would try again to write what a full disk has refused.
void start_library() {
  [[maybe_unused]] static const herr_t at_exit = H5dont_atexit();
  [[maybe_unused]] static thread_local const herr_t quiet = H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

// Why the last call failed: the system's words where it comes from the system, else HDF5's innermost message.
// Ask before any handle closes: that call would wipe the messages.
std::string cause() {
  struct Messages {
    std::string innermost, system;
  } messages;
  const auto note = [](unsigned, const H5E_error2_t* entry, void* data) -> herr_t {
    auto& found = *static_cast<Messages*>(data);
    const std::string text = entry->desc ? entry->desc : "";
    if (found.innermost.empty()) found.innermost = text;
    static constexpr char key[] = "errno = ";
    if (const auto at = text.find(key); at != std::string::npos && found.system.empty()) {
      found.system = std::strerror(std::atoi(text.c_str() + at + sizeof key - 1));
    }
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, note, &messages);
  return !messages.system.empty() ? messages.system : messages.innermost;
}

Handle property_list(hid_t kind) { return Handle(H5Pcreate(kind), H5Pclose); }

Handle without_times(hid_t kind) {
  Handle list = property_list(kind);
  H5Pset_obj_track_times(list, false);
  return list;
}

Handle access_list(H5F_libver_t format) {
  Handle list = property_list(H5P_FILE_ACCESS);
  H5Pset_libver_bounds(list, format, H5F_LIBVER_V110);
  H5Pset_file_locking(list, false, true);
  // Of a file that grows, what does not fit its checksum is read again after pauses that double from a
  // nanosecond on: by default 100 times, which is for ever on a damaged one.
  H5Pset_metadata_read_attempts(list, 25);
  return list;
}

Handle string_type(std::size_t size) {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, size);
  if (size != H5T_VARIABLE) H5Tset_strpad(type, H5T_STR_NULLPAD);
  H5Tset_cset(type, H5T_CSET_UTF8);
  return type;
}

std::vector<hsize_t> extent(Element element, hsize_t rows) {
  return element.columns == 1 ? std::vector{rows} : std::vector{rows, element.columns};
}

Handle space(const std::vector<hsize_t>& extent, const std::vector<hsize_t>& most) {
  return Handle(H5Screate_simple(static_cast<int>(extent.size()), extent.data(), most.data()), H5Sclose);
}

// Of a dataset with so many rows some.
Handle part(Element element, hsize_t first, hsize_t all, hsize_t count) {
  Handle whole = space(extent(element, all), extent(element, all));
  if (count == all) return whole;
  const hsize_t from[2] = {first, 0}, size[2] = {count, element.columns};
  H5Sselect_hyperslab(whole, H5S_SELECT_SET, from, nullptr, size, nullptr);
  return whole;
}

Handle scalar() { return Handle(H5Screate(H5S_SCALAR), H5Sclose); }

bool same_kind(hid_t type, hid_t expected) {
  return H5Tget_class(type) == H5Tget_class(expected) && H5Tget_size(type) == H5Tget_size(expected);
}

}  // namespace

std::string Group::where(const std::string& name) const {
  const std::string object = prefix_ + (name.empty() ? "" : "/" + name);
  return object.empty() ? file_ : file_ + ": " + object;
}

hid_t Group::check(hid_t result, const std::string& name, const char* action) const {
  if (result < 0) throw error(where(name), ": cannot ", action, ": ", cause());
  return result;
}

Group Group::create_group(const std::string& name) const {
  const hid_t group =
      H5Gcreate2(id_, name.c_str(), H5P_DEFAULT, without_times(H5P_GROUP_CREATE), H5P_DEFAULT);
  return Group(Handle(check(group, name, "create the group"), H5Gclose), file_, prefix_ + "/" + name);
}

Group Group::open_group(const std::string& name) const {
  const hid_t group = H5Gopen2(id_, name.c_str(), H5P_DEFAULT);
  return Group(Handle(check(group, name, "open the group"), H5Gclose), file_, prefix_ + "/" + name);
}

Handle Group::create_dataset(const std::string& name, Element element, hsize_t rows, hsize_t chunk) const {
  const Handle creation = without_times(H5P_DATASET_CREATE);
  const std::vector<hsize_t> now = extent(element, rows);
  std::vector<hsize_t> most = now;
  if (chunk) {
    H5Pset_chunk(creation, static_cast<int>(now.size()), extent(element, chunk).data());
    most[0] = H5S_UNLIMITED;
  }
  const Handle shape = space(now, most);
  const hid_t dataset =
      H5Dcreate2(id_, name.c_str(), element.type, shape, H5P_DEFAULT, creation, H5P_DEFAULT);
  return Handle(check(dataset, name, "create the dataset"), H5Dclose);
}

Handle Group::open_dataset(const std::string& name) const {
  return Handle(check(H5Dopen2(id_, name.c_str(), H5P_DEFAULT), name, "open the dataset"), H5Dclose);
}

hsize_t Group::size(hid_t dataset, const std::string& name, Element expected) const {
  const Handle type(check(H5Dget_type(dataset), name, "read the type"), H5Tclose);
  const Handle space(check(H5Dget_space(dataset), name, "read the size"), H5Sclose);
  std::array<hsize_t, H5S_MAX_RANK> extent{};
  const int rank = H5Sget_simple_extent_dims(space, extent.data(), nullptr);
  const bool table = rank == (expected.columns == 1 ? 1 : 2) && (rank == 1 || extent[1] == expected.columns);
  if (!table || !same_kind(type, expected.type)) {
    throw error(where(name), ": not ", expected.columns, " column(s) of the expected type of number");
  }
  return extent[0];
}

void Group::expect_written(herr_t result) const {
  if (result < 0) throw error(file_, ": cannot write: ", cause());
}

void Group::write_dataset(hid_t dataset, Element element, const void* rows) const {
  expect_written(H5Dwrite(dataset, element.type, H5S_ALL, H5S_ALL, H5P_DEFAULT, rows));
}

void Group::write_block(hid_t dataset, Element element, hsize_t first, hsize_t all, hsize_t count,
                        const void* rows) const {
  const Handle there = part(element, first, all, count), here = part(element, 0, count, count);
  expect_written(H5Dwrite(dataset, element.type, here, there, H5P_DEFAULT, rows));
}

void Group::read_block(hid_t dataset, const std::string& name, Element element, hsize_t first, hsize_t all,
                       hsize_t count, void* rows) const {
  const Handle there = part(element, first, all, count), here = part(element, 0, count, count);
  check(H5Dread(dataset, element.type, here, there, H5P_DEFAULT, rows), name, "read");
}

void Group::read_dataset(hid_t dataset, const std::string& name, Element element, void* rows) const {
  check(H5Dread(dataset, element.type, H5S_ALL, H5S_ALL, H5P_DEFAULT, rows), name, "read");
}

void Group::write(const std::string& name, const std::vector<std::string>& rows) const {
  std::size_t longest = 1;
  for (const std::string& row : rows) longest = std::max(longest, row.size());
  std::string table;
  for (const std::string& row : rows) table += row + std::string(longest - row.size(), '\0');
  const Handle type = string_type(longest);
  const Handle dataset = create_dataset(name, {type}, rows.size());
  write_dataset(dataset, {type}, table.data());
}

void Group::read(const std::string& name, std::vector<std::string>& rows) const {
  const Handle dataset = open_dataset(name);
  const Handle type(check(H5Dget_type(dataset), name, "read the type"), H5Tclose);
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) != 0)
    throw error(where(name), ": not a column of texts of a fixed length");
  const std::size_t length = H5Tget_size(type), count = size(dataset, name, {type});
  std::string table(count * length, '\0');
  read_dataset(dataset, name, {type}, table.data());
  rows.clear();
  for (std::size_t k = 0; k < count; ++k)
    rows.push_back(table.substr(k * length, length)), rows.back().resize(std::strlen(rows.back().c_str()));
}

void Group::write(const std::string& name, const std::string& text) const { write(name, std::vector{text}); }

void Group::read(const std::string& name, std::string& text) const {
  std::vector<std::string> rows;
  read(name, rows);
  if (rows.size() != 1) throw error(where(name), ": ", rows.size(), " texts, 1 expected");
  text = rows[0];
}

void Group::label(hid_t object, const std::string& name, const std::string& attribute,
                  const std::string& text) const {
  const Handle type = string_type(H5T_VARIABLE), shape = scalar();  // h5py gives str, of a fixed length bytes
  const hid_t id = H5Acreate2(object, attribute.c_str(), type, shape, H5P_DEFAULT, H5P_DEFAULT);
  const Handle handle(check(id, name, "create an attribute"), H5Aclose);
  const char* value = text.c_str();
  check(H5Awrite(handle, type, &value), name, "write an attribute");
}

void Group::set_attribute(const std::string& name, Element element, const void* value) const {
  const Handle shape = element.columns == 1 ? scalar() : space({element.columns}, {element.columns});
  const hid_t id = H5Acreate2(id_, name.c_str(), element.type, shape, H5P_DEFAULT, H5P_DEFAULT);
  const Handle attribute(check(id, name, "create the attribute"), H5Aclose);
  check(H5Awrite(attribute, element.type, value), name, "write the attribute");
}

void Group::get_attribute(const std::string& name, Element element, void* value) const {
  const Handle attribute(check(H5Aopen(id_, name.c_str(), H5P_DEFAULT), name, "read the attribute"),
                         H5Aclose);
  const Handle type(H5Aget_type(attribute), H5Tclose), space(H5Aget_space(attribute), H5Sclose);
  if (H5Sget_simple_extent_npoints(space) != static_cast<hssize_t>(element.columns) ||
      !same_kind(type, element.type)) {
    throw error(where(name), ": not ", element.columns, " number(s) of the expected type");
  }
  check(H5Aread(attribute, element.type, value), name, "read the attribute");
}

File File::create(const std::filesystem::path& path) {
  start_library();
  const Handle creation = without_times(H5P_FILE_CREATE), access = access_list(H5F_LIBVER_V110);
  const hid_t id = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation, access);
  if (id < 0) throw error(path.string(), ": cannot create the file: ", cause());
  return File(Handle(id, H5Fclose), path.string(), "");
}

File File::create(const Aside& place) {
  start_library();
  // The earliest format: what reads one file that was ever written reads all of them.
  const Handle creation = without_times(H5P_FILE_CREATE), access = access_list(H5F_LIBVER_EARLIEST);
  H5Pset_userblock(creation, seal_size);
  H5Pset_sieve_buf_size(access, 0);  // lest a column wait in it until a handle closes, which reports nothing
  const std::string path = place.path().string();
  const hid_t id = H5Fcreate(place.file().c_str(), H5F_ACC_TRUNC, creation, access);
  if (id < 0) throw error(path, ": cannot create the file: ", cause());
  return File(Handle(id, H5Fclose), path, "");
}

void File::close() {
  flush();
  check(H5Fclose(id_.release()), {}, "write");
}

File File::open(const std::filesystem::path& path, unsigned flags) {
  start_library();
  const Handle access = access_list(H5F_LIBVER_V110);
  const hid_t id = H5Fopen(path.c_str(), flags, access);
  if (id < 0) {
    const std::string why = cause();
    if (H5Fis_hdf5(path.c_str()) == 0) throw error(path.string(), ": not an HDF5 file");
    throw error(path.string(), ": cannot open the file: ", why);
  }
  return File(Handle(id, H5Fclose), path.string(), "");
}

void File::flush() const { check(H5Fflush(id_, H5F_SCOPE_LOCAL), {}, "write"); }

}  // namespace moraine::output::hdf5
