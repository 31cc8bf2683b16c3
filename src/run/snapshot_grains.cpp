#include "run/snapshot_grains.hpp"

#include "dem/packing.hpp"
#include "dem/periodic_sides.hpp"
#include "error.hpp"
#include "output/files.hpp"
#include "output/sealed.hpp"

namespace moraine::run {

OwnGrains read_snapshot_grains(const cases::Case& c) {
  output::Snapshot snapshot;
  try {
    snapshot = output::read_snapshot(c.start);
  } catch (const output::Damaged& e) {
    throw error(e.what(), "; expected an undamaged copy, or another snapshot");
  }
  if (snapshot.r.empty()) throw error(c.start.string(), ": has no grains");
  expect_same_sides(c, snapshot.box, {true, true, true});  // what was periodic there it does not say
  const auto side = [](double wanted, double found) { return wanted > 0 ? wanted : found; };
  OwnGrains own{c.start,
                dem::grains_at_rest(std::move(snapshot.r), std::move(snapshot.x)),
                {},
                side(c.box_x, snapshot.box.x),
                side(c.box_y, snapshot.box.y),
                side(c.box_z, snapshot.box.z)};
  dem::State& s = own.state;
  s.v = std::move(snapshot.v), s.omega = std::move(snapshot.omega);
  s.rotation = std::move(snapshot.rotation), s.material = std::move(snapshot.material);
  s.wall_z() = snapshot.top_wall;
  own.roles = std::move(snapshot.role);
  dem::Scene box;
  box.box = {own.box_x, own.box_y, own.box_z};
  box.periodic_x = c.periodic_x, box.periodic_y = c.periodic_y, box.periodic_z = c.periodic_z;
  const dem::Sides sides = dem::Sides::of(box);
  s.contacts.reserve(snapshot.i.size());
  for (std::size_t k = 0; k < snapshot.i.size(); ++k) {
    dem::Contact contact{snapshot.i[k], snapshot.j[k], {}};
    const double r_i = s.r[contact.i], r_j = s.r[contact.j];
    const double k_t = dem::tangential_stiffness_of(
        c.contact, dem::between_grains(dem::nearest_image(sides, s.x[contact.i] - s.x[contact.j]), r_i + r_j,
                                       r_i - r_j));
    if (!(k_t > 0)) continue;
    contact.spring.delta_t = -1 / k_t * snapshot.f_t[k];
    s.contacts.push_back(contact);
  }
  own.note = text("the grains are those of a snapshot, ", c.start.filename().string(),
                  ": springs bear its tangential forces; it knows no springs at walls or of rolling, and no "
                  "speed of the top "
                  "wall, so that the run that it comes from would go on with other bits");
  return own;
}

}  // namespace moraine::run
