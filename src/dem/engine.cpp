#include "dem/engine.hpp"

#include "backend/team.hpp"
#include "dem/ranks/ranked_engine.hpp"
#include "error.hpp"

namespace moraine::dem {

std::unique_ptr<Engine> make_pair_engine(int threads);
std::unique_ptr<Engine> make_reference_engine(int threads);
#if defined(MORAINE_CUDA)
std::unique_ptr<Engine> make_cuda_engine();
bool cuda_device_found();
#endif

bool cuda_built() {
#if defined(MORAINE_CUDA)
  return true;
#else
  return false;
#endif
}

bool cuda_device_present() {
#if defined(MORAINE_CUDA)
  return cuda_device_found();
#else
  return false;
#endif
}

std::unique_ptr<Engine> make_engine(Backend backend, int threads, Ranks* ranks) {
  if (ranks) {
    if (backend != Backend::cpu && backend != Backend::automatic)
      throw error("--backend cuda: several ranks share a bed on CPUs only; use --backend cpu, or one rank");
    return make_ranked_engine(*ranks, threads);
  }
  if (backend == Backend::reference) return make_reference_engine(threads > 0 ? threads : available_cores());
  if (backend == Backend::automatic) backend = cuda_device_present() ? Backend::cuda : Backend::cpu;
  if (backend == Backend::cpu) return make_pair_engine(threads);
  if (!cuda_built())
    throw error(
        "--backend cuda: this build has no CUDA in it; configure with -DMORAINE_CUDA=ON (./moraine --cuda "
        "...) where nvcc is installed");
  if (!cuda_device_present()) throw error("--backend cuda: no NVIDIA GPU was found; use --backend cpu");
#if defined(MORAINE_CUDA)
  return make_cuda_engine();
#else
  return nullptr;
#endif
}

}  // namespace moraine::dem
