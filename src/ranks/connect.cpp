// Loads the module that knows MPI, where there is a reason to.
#include <dlfcn.h>

#include <cstdlib>
#include <filesystem>

#include "ranks/ranks.hpp"

namespace moraine {

namespace {

// Whether this process is to speak for all that were started with it, before they know each other.
bool speaks_for_all() {
  for (const char* name : {"OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "SLURM_PROCID"})
    if (const char* rank = std::getenv(name)) return std::atoi(rank) == 0;
  return true;
}
template <class... Words>
[[noreturn]] void fail(const Words&... words) {
  if (!speaks_for_all()) std::_Exit(1);
  throw error(words...);
}

// So many processes were started together: by OpenMPI's mpirun, MPICH's or Intel's, or srun.
int started_together() {
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"})
    if (const char* size = std::getenv(name)) return std::atoi(size);
  const char* const tasks = std::getenv("SLURM_STEP_NUM_TASKS");
  if (!tasks || std::atoi(tasks) <= 1) return 1;
  if (!std::getenv("PMIX_RANK") && !std::getenv("PMI_RANK"))
    fail("srun started ", tasks,
         " tasks that do not know each other; use mpirun or srun --mpi=pmix, or one task");
  return std::atoi(tasks);
}

}  // namespace

std::unique_ptr<Ranks> connect_ranks() {
  const int started = started_together();
  if (started <= 1) return nullptr;
  std::error_code failed;
  const std::filesystem::path module =
      std::filesystem::read_symlink("/proc/self/exe", failed).parent_path() / "moraine_mpi.so";
  if (!std::filesystem::exists(module, failed))
    fail("started on ", started, " ranks, but there is no ", module.string(),
         ": configure with -DMORAINE_MPI=ON where MPI is installed (Debian: libopenmpi-dev), or use "
         "./moraine run CASE "
         "--ranks ",
         started);
  // Global, since MPI loads modules of its own that look for its symbols.
  void* const library = dlopen(module.c_str(), RTLD_NOW | RTLD_GLOBAL);
  if (!library) fail(module.string(), ": cannot be loaded: ", dlerror());
  auto* const connect = reinterpret_cast<Ranks* (*)()>(dlsym(library, "moraine_ranks"));
  if (!connect) fail(module.string(), ": is not the module of this program: ", dlerror());
  std::unique_ptr<Ranks> ranks(connect());
  if (ranks->size() != started)
    fail("started on ", started, " ranks, and ", module.string(), " finds ", ranks->size(),
         ": it was built with another MPI than the one that started them; use the mpirun of that one");
  return ranks;
}

}  // namespace moraine
