// What moves the grains. Two engines share one physics (contact.hpp, leapfrog.hpp): PairEngine for the CPU
// walks pairs in SIMD packs; GatherEngine for the GPU lets each grain walk its own contacts (it also runs on
// the host, for tests).
#pragma once
#include <cstdint>
#include <memory>
#include <string>

#include "dem/fluid_coupling.hpp"
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine {
class Ranks;
}

namespace moraine::dem {

class Engine {
 public:
  virtual ~Engine() = default;

  // Takes the state over. One that is not staggered gets its forces evaluated (springs as they are) and its
  // velocities taken half a step back; all others go on with the same bits. Throws Error on an unsupported
  // scene.
  // fluid: where scene.exchange_interval > 0, and then for as long as the engine runs.
  virtual void load(const Scene& scene, const State& state, FluidCoupling* fluid = nullptr) = 0;

  // Takes from the scene what drives the bodies from the present step on, of the same kinds as before; all
  // else goes on. No search, no load: made for histories of many pieces.
  virtual void redrive(const Scene& scene) = 0;

  // Advances so many steps. Throws Error naming grain, step and place when a number stops being finite or a
  // grain leaves.
  virtual void advance(std::int64_t steps) = 0;

  // The staggered state at the present step; or the grains and bodies of it, without contacts, which takes a
  // fraction of the time.
  State state() const { return read(/*contacts=*/true); }
  State grains() const { return read(/*contacts=*/false); }

  struct Counts {
    std::int64_t candidates = 0;  // pairs within the neighbour margin
    std::int64_t near = 0;        // pairs evaluated at each step
    std::int64_t rebuilds = 0;    // of the candidates
    double search_seconds = 0;    // that these took, where the engine times them
    std::int64_t ghosts = 0;      // copies of grains that ranks have of each other's
    std::int64_t bytes_sent = 0;  // by ranks to each other in steps, so far
    double most_work = 1;         // of a rank, over the mean; in pairs, at the last search
  };
  virtual Counts counts() const = 0;
  virtual std::string describe() const = 0;  // e.g. "cpu, 2 threads, AVX2"
  virtual int threads() const = 0;

 protected:
  virtual State read(bool contacts) const = 0;
};

enum class Backend { automatic, cpu, cuda, reference };  // reference: the GPU's loop on the host

// threads = 0: one for each core that this process may use, but fewer for a small bed. ranks: that share the
// bed, where there are several; this is rank 0 (ranks/ranked_engine.hpp). Throws Error where the backend is
// not built in, has no device, or takes no ranks.
std::unique_ptr<Engine> make_engine(Backend backend, int threads = 0, Ranks* ranks = nullptr);

bool cuda_built();
bool cuda_device_present();

// Velocities and spins from n - 1/2 to n, as between stages.
void synchronise(const Scene& scene, State& state);

// Goes on with another time step from here: velocities and spins to n and back by half a new step, with the
// forces as they stand. Second order, as the scheme is; load() the result.
void change_step(Scene& scene, State& state, double dt);

}  // namespace moraine::dem
