// Loads the module that knows MPI, where there is a reason to.
#include <dlfcn.h>

#include <cstdlib>
#include <filesystem>

#include "ranks/ranks.hpp"

namespace moraine {

namespace {

// So many processes were started together: OpenMPI's mpirun, MPICH's and Intel's, srun.
int started_together() {
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"})
    if (const char* size = std::getenv(name)) return std::atoi(size);
  if (std::getenv("PMIX_RANK") || std::getenv("PMI_RANK"))  // srun --mpi=pmix, --mpi=pmi2
    if (const char* size = std::getenv("SLURM_STEP_NUM_TASKS")) return std::atoi(size);
  return 1;
}

}  // namespace

std::unique_ptr<Ranks> connect_ranks() {
  if (started_together() <= 1) return nullptr;
  std::error_code failed;
  const std::filesystem::path module =
      std::filesystem::read_symlink("/proc/self/exe", failed).parent_path() / "moraine_mpi.so";
  if (!std::filesystem::exists(module, failed))
    throw error(
        "started on ", started_together(),
        " ranks, but this program was built without MPI: configure with -DMORAINE_MPI=ON where MPI is "
        "installed (Debian: libopenmpi-dev), or use ./moraine run CASE --ranks N");
  // Global, since MPI loads modules of its own that look for its symbols.
  void* const library = dlopen(module.c_str(), RTLD_NOW | RTLD_GLOBAL);
  if (!library) throw error(module.string(), ": cannot be loaded: ", dlerror());
  auto* const connect = reinterpret_cast<Ranks* (*)()>(dlsym(library, "moraine_ranks"));
  if (!connect) throw error(module.string(), ": is not the module of this program: ", dlerror());
  return std::unique_ptr<Ranks>(connect());
}

}  // namespace moraine
