#include "run/rank.hpp"

#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>

#include "dem/ranks/ranked_engine.hpp"
#include "output/sealed.hpp"

namespace moraine::run {

namespace {

struct Build {
  char digest[64] = {}, module[64] = {};  // of the program's file, and of the module with MPI
  char host[64] = {};
};

// Throws Error on all ranks where one runs another program than rank 0: they would not understand each other,
// and bits would be nobody's.
void expect_one_build(Ranks& ranks) {
  Build own;
  try {
    const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe");
    const std::string digest = output::digest_of_file(program),
                      module = output::digest_of_file(program.parent_path() / "moraine_mpi.so");
    digest.copy(own.digest, sizeof own.digest), module.copy(own.module, sizeof own.module);
  } catch (const std::exception& e) {
    ranks.abort(in_words(e));
  }
  gethostname(own.host, sizeof own.host - 1);
  const std::vector<Build> all = of_all(ranks, own);
  for (std::size_t r = 1; r < all.size(); ++r)
    if (!std::ranges::equal(all[r].digest, all[0].digest) ||
        !std::ranges::equal(all[r].module, all[0].module))
      throw error("rank ", r, " (on ", all[r].host, ") runs another build of moraine than rank 0 (on ",
                  all[0].host, "); start the same file on all hosts");
}

}  // namespace

int serve(Ranks& ranks) {
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1}) std::signal(signal, SIG_IGN);
  try {
    expect_one_build(ranks);
  } catch (const Error&) {
    return 1;  // rank 0 says it
  }
  dem::serve(ranks);
  return 0;
}

Served::Served(Ranks* ranks) : ranks_(ranks) {
  if (ranks_) expect_one_build(*ranks_);
}
Served::~Served() {
  if (ranks_) dem::dismiss(*ranks_);
}

}  // namespace moraine::run
