// A thin layer over the HDF5 C library: handles close themselves, and a failure becomes an Error that names
// the file, the object in it and the cause. No time stamps: equal content gives equal bytes. File locks are
// off: the lock of a reader would stop a writer, and some file systems have none. Texts have a fixed length,
// since of damaged ones of variable length the library makes wild pointers; labels, which the program never
// reads back, are variable. Any HDF5 from 1.10 on reads the files.
#pragma once
#include <hdf5.h>

#include <algorithm>
#include <concepts>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "dem/vec3.hpp"
#include "output/aside.hpp"

namespace moraine::output::hdf5 {

// Several cases may run in one process, and the library may be built for one thread only: whoever calls it,
// or closes a handle, holds this.
class Lock {
  std::lock_guard<std::recursive_mutex> held_{mutex_};
  static inline std::recursive_mutex mutex_;
};

class Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Handle() = default;
  Handle(hid_t id, Close close) : id_(id), close_(close) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, H5I_INVALID_HID)), close_(other.close_) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  operator hid_t() const { return id_; }
  hid_t release() { return std::exchange(id_, H5I_INVALID_HID); }

 private:
  hid_t id_ = H5I_INVALID_HID;
  Close close_ = nullptr;
};

// Structs that are nothing but doubles: stored as rows of so many columns.
template <class T>
constexpr bool all_doubles = std::same_as<T, double>;
template <>
inline constexpr bool all_doubles<dem::Vec3d> = true;

// How one T is stored: as `columns` numbers of one type.
struct Element {
  hid_t type;
  hsize_t columns = 1;
};

template <class T>
Element element() {
  if constexpr (all_doubles<T>) {
    return {H5T_NATIVE_DOUBLE, sizeof(T) / sizeof(double)};
  } else if constexpr (std::is_enum_v<T>) {
    return element<std::underlying_type_t<T>>();
  } else if constexpr (std::same_as<T, std::uint8_t>) {
    return {H5T_NATIVE_UINT8};
  } else if constexpr (std::same_as<T, std::int32_t>) {
    return {H5T_NATIVE_INT32};
  } else {
    static_assert(std::same_as<T, std::int64_t>);
    return {H5T_NATIVE_INT64};
  }
}

class Group {
 public:
  Group create_group(const std::string& name) const;
  Group open_group(const std::string& name) const;

  // Datasets
  template <class T>
  void write(const std::string& name, const std::vector<T>& rows, const char* units = nullptr) const {
    const Handle dataset = create_dataset(name, element<T>(), rows.size());
    write_dataset(dataset, element<T>(), rows.data());
    if (units) label(dataset, name, "units", units);
  }
  // The same of rows that are nowhere side by side: at(k) is the k-th. A block of them is gathered at a time.
  template <class T, class At>
  void write_rows(const std::string& name, std::size_t count, At&& at, const char* units = nullptr) const {
    const Handle dataset = create_dataset(name, element<T>(), count);
    std::vector<T> block(std::min(count, block_rows));
    std::size_t first = 0;
    do {
      block.resize(std::min(count - first, block_rows));
      for (std::size_t k = 0; k < block.size(); ++k) block[k] = at(first + k);
      write_block(dataset, element<T>(), first, count, block.size(), block.data());
      first += block.size();
    } while (first < count);
    if (units) label(dataset, name, "units", units);
  }
  void write(const std::string& name, const std::vector<std::string>& rows) const;
  void write(const std::string& name, const std::string& text) const;
  template <class T>
  void read(const std::string& name, std::vector<T>& rows) const {
    const Handle dataset = open_dataset(name);
    rows.resize(size(dataset, name, element<T>()));
    read_dataset(dataset, name, element<T>(), rows.data());
  }
  // begin(count), then take(k, row) of one after the other.
  template <class T, class Begin, class Take>
  void read_rows(const std::string& name, Begin&& begin, Take&& take) const {
    const Handle dataset = open_dataset(name);
    const std::size_t count = size(dataset, name, element<T>());
    begin(count);
    std::vector<T> block(std::min(count, block_rows));
    for (std::size_t first = 0; first < count; first += block.size()) {
      block.resize(std::min(count - first, block_rows));
      read_block(dataset, name, element<T>(), first, count, block.size(), block.data());
      for (std::size_t k = 0; k < block.size(); ++k) take(first + k, block[k]);
    }
  }
  void read(const std::string& name, std::vector<std::string>& rows) const;
  void read(const std::string& name, std::string& text) const;

  // Attributes of the group
  template <class T>
  void set(const std::string& name, const T& value) const {
    set_attribute(name, element<T>(), &value);
  }
  void set(const std::string& name, const std::string& value) const { label(id_, {}, name, value); }
  template <class T>
  void get(const std::string& name, T& value) const {
    get_attribute(name, element<T>(), &value);
  }
  bool holds(const std::string& name) const { return H5Lexists(id_, name.c_str(), H5P_DEFAULT) > 0; }

  // Steps of the above, for datasets that grow: chunk = 0 is a fixed size
  Handle create_dataset(const std::string& name, Element element, hsize_t rows, hsize_t chunk = 0) const;
  Handle open_dataset(const std::string& name) const;
  hsize_t size(hid_t dataset, const std::string& name, Element expected) const;  // throws if of another kind
  void write_dataset(hid_t dataset, Element element, const void* rows) const;
  void read_dataset(hid_t dataset, const std::string& name, Element element, void* rows) const;
  // Rows [first, first + count) of all there are.
  void write_block(hid_t dataset, Element element, hsize_t first, hsize_t all, hsize_t count,
                   const void* rows) const;
  void read_block(hid_t dataset, const std::string& name, Element element, hsize_t first, hsize_t all,
                  hsize_t count, void* rows) const;
  void label(hid_t object, const std::string& name, const std::string& attribute,
             const std::string& text) const;

  std::string where(const std::string& name = {}) const;  // "series.h5: /name", as errors put it
  // Passes the result of an HDF5 call on, or throws "FILE: /name: cannot ACTION: CAUSE".
  hid_t check(hid_t result, const std::string& name, const char* action) const;
  // The same of rows, "FILE: cannot write: CAUSE": what the disk refuses has nothing to do with the object.
  void expect_written(herr_t result) const;

 protected:
  Group(Handle id, std::string file, std::string prefix)
      : id_(std::move(id)), file_(std::move(file)), prefix_(std::move(prefix)) {}
  Handle id_;
  std::string file_, prefix_;

 private:
  static constexpr std::size_t block_rows = 1 << 16;
  void set_attribute(const std::string& name, Element element, const void* value) const;
  void get_attribute(const std::string& name, Element element, void* value) const;
};

class File : public Group {
 public:
  static File open(const std::filesystem::path& path, unsigned flags);
  static File create(const std::filesystem::path& path);
  void flush() const;

  // A new file with room for a seal (sealed.hpp) in front; errors name the place that it is to have. What
  // stands in it is on the disk once close() has returned.
  static File create(const Aside& place);
  void close();

 private:
  using Group::Group;
};

}  // namespace moraine::output::hdf5
