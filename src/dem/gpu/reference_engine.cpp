#include "dem/gpu/gather_engine.hpp"

namespace moraine::dem {

std::unique_ptr<Engine> make_reference_engine(int threads) {
  Host host;
  host.threads = threads;
  return std::make_unique<gpu::GatherEngine<Host>>(
      host, "reference (the GPU's loop on the host), threads: " + std::to_string(threads));
}

}  // namespace moraine::dem
