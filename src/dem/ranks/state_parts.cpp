#include "dem/ranks/state_parts.hpp"

#include <algorithm>

namespace moraine::dem {

namespace {

// use(list) of all that a state has by grain, but materials.
template <class StateOrConst, class Use>
void for_each_list(StateOrConst& s, Use&& use) {
  use(s.id), use(s.r), use(s.x), use(s.v), use(s.omega), use(s.rotation), use(s.force), use(s.torque);
  use(s.water_force), use(s.x_start), use(s.part_of);
}

// What is not by grain.
struct Common {
  std::array<BodyState, body_ids> bodies;
  WaterReaction water;
  Ledger ledger;
  std::int64_t step;
  bool staggered;
};

void put_common(Parcel& parcel, const State& s) {
  parcel.put(Common{s.bodies, s.water, s.ledger, s.step, s.staggered});
}
void get_common(Parcel& parcel, State& s) {
  Common c;
  parcel.get(c);
  s.bodies = c.bodies, s.water = c.water, s.ledger = c.ledger, s.step = c.step, s.staggered = c.staggered;
}

}  // namespace

std::vector<Index> deal_chunks(const State& s, int ranks) {
  const Index size = chunk_size(s.size()), chunks = chunk_count(s.size());
  std::vector<double> work(chunks, 0.3 * size);
  for (const Contact& c : s.contacts) ++work[c.i / size];
  double all = 0, before = 0;
  for (const double w : work) all += w;
  std::vector<Index> first{0};
  for (Index c = 0; c < chunks && static_cast<int>(first.size()) < ranks; before += work[c++]) {
    const auto next = static_cast<int>(first.size());
    const bool due = ranks * (before + 0.5 * work[c]) >= all * next, last_chance = chunks - c == ranks - next;
    if (c > first.back() && (due || last_chance)) first.push_back(c);
  }
  first.push_back(chunks);
  return first;
}

void put_part(Parcel& parcel, const State& s, Index first, Index end) {
  put_common(parcel, s);
  for_each_list(s, [&](const auto& list) { parcel.put_list(list, first, end); });
  std::vector<Material> material;
  if (!s.material.empty()) material.assign(s.material.begin() + first, s.material.begin() + end);

  std::vector<Contact> contacts;
  std::vector<Index> ghosts;
  const auto from = std::ranges::lower_bound(s.contacts, first, {}, &Contact::i);
  for (auto c = from; c != s.contacts.end() && c->i < end; ++c) {
    contacts.push_back({c->i - first, c->j - first, c->spring});
    if (c->j >= end) ghosts.push_back(c->j);
  }
  std::ranges::sort(ghosts);
  ghosts.erase(std::unique(ghosts.begin(), ghosts.end()), ghosts.end());
  if (!s.material.empty())
    for (const Index j : ghosts) material.push_back(s.material[j]);
  parcel.put_list(material), parcel.put_list(contacts);

  std::vector<WallContact> walls;
  for (const WallContact& w : s.wall_contacts)
    if (w.i >= first && w.i < end) walls.push_back({w.i - first, w.wall, w.spring});
  parcel.put_list(walls);
}

void get_part(Parcel& parcel, State& s) {
  get_common(parcel, s);
  for_each_list(s, [&](auto& list) { parcel.add_to(list); });
  parcel.add_to(s.material), parcel.add_to(s.contacts), parcel.add_to(s.wall_contacts);
}

void put_all(Parcel& parcel, const State& s) {
  put_common(parcel, s);
  for_each_list(s, [&](const auto& list) { parcel.put_list(list); });
  parcel.put_list(s.material), parcel.put_list(s.contacts), parcel.put_list(s.wall_contacts);
}

void add_part(Parcel& parcel, State& s, Index first) {
  State unused;
  get_common(parcel, unused);
  const std::size_t contacts = s.contacts.size(), walls = s.wall_contacts.size();
  for_each_list(s, [&](auto& list) { parcel.add_to(list); });
  parcel.add_to(s.material), parcel.add_to(s.contacts), parcel.add_to(s.wall_contacts);
  for (std::size_t k = contacts; k < s.contacts.size(); ++k)
    s.contacts[k].i += first, s.contacts[k].j += first;
  for (std::size_t k = walls; k < s.wall_contacts.size(); ++k) s.wall_contacts[k].i += first;
}

}  // namespace moraine::dem
