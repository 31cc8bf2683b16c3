// What a run has computed, as short digests: the numbers, not the files, so that formats and types may change
// while a digest stays. A table of them is kept in reference_bits.txt.
#pragma once
#include <gnu/libc-version.h>
#include <hdf5.h>
#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <concepts>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "output/files.hpp"

// Their versions only.
#if __has_include(<suitesparse/SuiteSparse_config.h>)
#include <suitesparse/SuiteSparse_config.h>
#endif
#if __has_include(<sundials/sundials_config.h>)
#include <sundials/sundials_config.h>
#endif

namespace moraine {

// SHA-256 of numbers in the order they are fed, of which the first 64 bits are kept.
class Digest {
 public:
  Digest() : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) {
    if (!EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr))
      throw std::runtime_error("libcrypto has no SHA-256");
  }
  void bytes(const void* data, std::size_t size) { EVP_DigestUpdate(context_.get(), data, size); }

  // Each number with its own width; a list with its length in front.
  template <class T>
  requires std::same_as<T, double> || std::same_as<T, std::uint8_t> || std::same_as<T, std::int32_t> ||
      std::same_as<T, std::int64_t>
  void feed(T number) { bytes(&number, sizeof number); }
  void feed(const dem::Vec3d& a) { feed(a.x), feed(a.y), feed(a.z); }
  template <class T>
  void feed(const std::vector<T>& list) {
    feed(static_cast<std::int64_t>(list.size()));
    for (const T& one : list) feed(one);
  }

  std::string digits() const {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
    EVP_DigestFinal_ex(context_.get(), digest.data(), nullptr);
    std::string text;
    for (int k = 0; k < 8; ++k)
      for (const int digit : {digest[k] >> 4, digest[k] & 15}) text += "0123456789abcdef"[digit];
    return text;
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

inline const std::array<std::string, 6> parts{"series", "grains", "contacts", "walls", "water", "ledger"};
using Digests = std::array<std::string, parts.size()>;  // in that order

// The last state. Where State changes, this function is all that has to follow: what is fed, in which order
// and as which type of number, stays.
inline void feed_state(const output::Checkpoint& c, Digest& grains, Digest& contacts, Digest& walls,
                       Digest& water, Digest& ledger) {
  const dem::State& s = c.state;
  grains.feed(s.step);
  grains.feed(s.id), grains.feed(s.r), grains.feed(s.x), grains.feed(s.v), grains.feed(s.omega);
  grains.feed(s.rotation), grains.feed(s.force), grains.feed(s.torque), grains.feed(s.water_force);
  grains.feed(s.x_start);
  for (const dem::BodyId layer : s.part_of)
    grains.feed(static_cast<std::uint8_t>(layer));  // 0 none, 1 bottom, 2 top

  for (const dem::Contact& k : s.contacts)
    contacts.feed(k.i), contacts.feed(k.j), contacts.feed(k.spring.delta_t), contacts.feed(k.spring.slipping);

  for (const dem::WallContact& k : s.wall_contacts) {
    const auto wall = static_cast<std::int32_t>(k.wall) - static_cast<std::int32_t>(dem::BodyId::floor);
    walls.feed(k.i), walls.feed(wall);  // 0 floor, 1 top
    walls.feed(k.spring.delta_t), walls.feed(k.spring.slipping);
  }
  const dem::BodyState &top = s.at(dem::BodyId::top_wall), &layer = s.at(dem::BodyId::top_layer);
  for (const double of_wall : {top.x.z, top.v.z, top.force.z, layer.force.x, layer.v.x}) walls.feed(of_wall);

  for (const double of_water : {s.water.wall, s.water.layer, s.water.work, s.water.wall_between})
    water.feed(of_water);
  const coupling::WaterState& w = c.water;
  water.feed(w.q), water.feed(w.p), water.feed(w.exchanges);
  for (const double passed :
       {w.wall_pressure, w.drained_top, w.drained_bottom, w.drained_sides, w.dissipated})
    water.feed(passed);

  const dem::Ledger& l = s.ledger;
  for (const double joule : {l.slip, l.viscous, l.planes, l.layers, l.water}) ledger.feed(joule);
}

// Every dataset in the order of names: name, shape, numbers as they stand in the file.
inline void feed_series(const std::filesystem::path& path, Digest& series) {
  const auto fine = [&](auto result) {
    if (result < 0) throw std::runtime_error(path.string() + ": cannot be read");
    return result;
  };
  const hid_t file = fine(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
  std::vector<std::string> names;
  const auto add = [](hid_t, const char* name, const H5L_info_t*, void* list) -> herr_t {
    static_cast<std::vector<std::string>*>(list)->push_back(name);
    return 0;
  };
  fine(H5Literate(file, H5_INDEX_NAME, H5_ITER_INC, nullptr, add, &names));
  std::sort(names.begin(), names.end());
  for (const std::string& name : names) {
    const hid_t dataset = fine(H5Dopen2(file, name.c_str(), H5P_DEFAULT));
    const hid_t space = fine(H5Dget_space(dataset)), type = fine(H5Dget_type(dataset));
    std::vector<hsize_t> shape(static_cast<std::size_t>(fine(H5Sget_simple_extent_ndims(space))));
    fine(H5Sget_simple_extent_dims(space, shape.data(), nullptr));
    std::vector<char> numbers(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)) *
                              H5Tget_size(type));
    fine(H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()));
    series.bytes(name.data(), name.size() + 1);
    for (const hsize_t rows : shape) series.feed(static_cast<std::int64_t>(rows));
    series.bytes(numbers.data(), numbers.size());
    H5Tclose(type), H5Sclose(space), H5Dclose(dataset);
  }
  H5Fclose(file);
}

// Of a case's directory.
inline Digests digests_of(const std::filesystem::path& run) {
  std::array<Digest, parts.size()> d;
  feed_series(run / "output/series.h5", d[0]);
  feed_state(output::read_checkpoint(run / "output/checkpoint.h5"), d[1], d[2], d[3], d[4], d[5]);
  Digests digits;
  std::transform(d.begin(), d.end(), digits.begin(), [](const Digest& one) { return one.digits(); });
  return digits;
}

// What the bits may depend on beside the program's source.
inline std::string made_with() {
  std::string text = std::string("g++ ") + __VERSION__ + ", glibc " + gnu_get_libc_version();
#ifdef SUITESPARSE_MAIN_VERSION
  text += ", SuiteSparse " + std::to_string(SUITESPARSE_MAIN_VERSION);
  for (const int n : {SUITESPARSE_SUB_VERSION, SUITESPARSE_SUBSUB_VERSION})
    text.append(".").append(std::to_string(n));
#endif
#ifdef SUNDIALS_VERSION
  text += ", SUNDIALS " SUNDIALS_VERSION;
#endif
  return text;
}

}  // namespace moraine
