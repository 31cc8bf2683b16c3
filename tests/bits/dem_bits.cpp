// Prints a digest of what each small bed computes, on one and two threads and by the GPU's loop. Needs no
// library beside src/dem, so that it can be compiled for another processor than this one: what it prints must
// be the same there.
//   dem_bits [STEPS]
#include <cstdint>
#include <cstdio>
#include <vector>

#include "physics/named_beds.hpp"

namespace moraine::dem {
namespace {

// FNV-1a, 64 bits.
class Digest {
 public:
  template <class... Numbers>
  void feed(const Numbers&... numbers) {
    (bytes(&numbers, sizeof numbers), ...);
  }
  void feed(const Vec3d& a) { feed(a.x, a.y, a.z); }
  template <class T>
  void feed(const std::vector<T>& list) {
    for (const T& one : list) feed(one);
  }
  void feed(const Spring<double>& s) {
    feed(s.delta_t), feed(s.slipping), feed(s.v_before), feed(s.f_viscous);
  }
  void feed(const Contact& c) { feed(c.i, c.j), feed(c.spring); }
  void feed(const WallContact& c) { feed(c.i, c.wall), feed(c.spring); }
  void feed(const BodyState& b) { feed(b.x), feed(b.v), feed(b.force); }
  void feed(const Ledger& l) { feed(l.slip, l.viscous, l.planes, l.layers); }
  void feed(const State& s) {
    feed(s.id), feed(s.x), feed(s.v), feed(s.omega), feed(s.rotation), feed(s.force), feed(s.torque);
    feed(s.contacts), feed(s.wall_contacts), feed(s.ledger);
    for (const BodyState& b : s.bodies) feed(b);
  }
  std::uint64_t value() const { return hash_; }

 private:
  void bytes(const void* data, std::size_t size) {
    const auto* byte = static_cast<const unsigned char*>(data);
    for (std::size_t k = 0; k < size; ++k) hash_ = (hash_ ^ byte[k]) * 0x100000001b3;
  }
  std::uint64_t hash_ = 0xcbf29ce484222325;
};

void print_digests(std::int64_t settling, std::int64_t steps) {
  const auto print = [&](const NamedBed& bed, const char* engine, Backend backend, int threads) {
    const State end = run(*make_engine(backend, threads), bed.bed.scene, bed.bed.state, steps);
    Digest digest;
    digest.feed(end);
    std::printf("%016llx  %s, %s, %zu contacts\n", static_cast<unsigned long long>(digest.value()), bed.name,
                engine, end.contacts.size());
  };
  const std::vector<NamedBed> beds =
      named_beds(bed_after(settling), walled_bed_after(settling), make_graded_bed(9));
  for (const NamedBed& bed : beds) print(bed, "one thread", Backend::cpu, 1);
  print(beds[0], "two threads", Backend::cpu, 2);
  print(beds[0], "the GPU's loop", Backend::reference, 1);
}

}  // namespace
}  // namespace moraine::dem

int main() { moraine::dem::print_digests(10000, 400); }
