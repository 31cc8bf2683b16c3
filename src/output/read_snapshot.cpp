#include <algorithm>

#include "error.hpp"
#include "output/files.hpp"
#include "output/hdf5.hpp"
#include "output/sealed.hpp"

namespace moraine::output {

namespace {

constexpr const char* kind = "snapshot";
constexpr std::int64_t format = 1;

template <class... Lists>
void expect_rows(const hdf5::Group& group, std::size_t rows, const Lists&... lists) {
  if (((lists.size() != rows) || ...)) throw error(group.where(), ": columns of unequal length");
}

void validate(const hdf5::Group& grains, const hdf5::Group& contacts, const Snapshot& s) {
  const std::size_t n = s.r.size();
  expect_rows(grains, n, s.x, s.v, s.omega, s.rotation, s.role);
  expect_rows(contacts, s.i.size(), s.j, s.f_t);
  for (const dem::BodyId role : s.role)
    if (role != dem::BodyId::none && dem::shape_of(role) != dem::Body::Shape::layer)
      throw error(grains.where("role"), ": no grain can be part of ", dem::name_of(role));
  if (!s.material.empty()) expect_rows(grains, n, s.material);
  for (std::size_t k = 0; k < s.i.size(); ++k)
    if (s.i[k] < 0 || s.i[k] >= s.j[k] || static_cast<std::size_t>(s.j[k]) >= n)
      throw error(contacts.where(), ": no contact can be between grains ", s.i[k], " and ", s.j[k], " of ",
                  n);
}

}  // namespace

bool is_snapshot(const std::filesystem::path& path) { return kind_of(path) == kind; }

Snapshot read_snapshot(const std::filesystem::path& path) {
  const Sealed found = check_seal(path);
  if (found.kind != kind) throw Damaged(path.string() + ": not a snapshot of moraine, or damaged");
  if (found.format != format)
    throw error(path.string(), ": written by ", found.format > format ? "a later" : "an earlier",
                " version of moraine (snapshot format ", found.format, "; this one reads ", format, ")");
  const hdf5::Lock lock;
  const auto file = hdf5::File::open(path, H5F_ACC_RDONLY);
  Snapshot s;
  file.get("box", s.box);
  file.get("top_wall", s.top_wall);
  const hdf5::Group grains = file.open_group("grains"), contacts = file.open_group("contacts");
  grains.read("role", s.role);
  if (grains.holds("material")) grains.read("material", s.material);
  grains.read("radius", s.r);
  grains.read("position", s.x);
  grains.read("velocity", s.v);
  grains.read("spin", s.omega);
  grains.read("rotation", s.rotation);
  contacts.read("i", s.i);
  contacts.read("j", s.j);
  contacts.read("force_tangential", s.f_t);
  validate(grains, contacts, s);
  return s;
}

}  // namespace moraine::output
