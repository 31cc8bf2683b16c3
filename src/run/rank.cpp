#include "run/rank.hpp"

#include <unistd.h>

#include <algorithm>
#include <csignal>

#include "dem/ranks/ranked_engine.hpp"
#include "output/sealed.hpp"

namespace moraine::run {

namespace {

struct Build {
  char digest[64] = {}, host[64] = {};  // of the program's file; where it is
};

// Throws Error on all ranks where one runs another program than rank 0: they would not understand each other,
// and bits would be nobody's.
void expect_one_build(Ranks& ranks) {
  Build own;
  const std::string digest = output::digest_of_file("/proc/self/exe");
  digest.copy(own.digest, sizeof own.digest);
  gethostname(own.host, sizeof own.host - 1);
  const std::vector<Build> all = of_all(ranks, own);
  for (std::size_t r = 1; r < all.size(); ++r)
    if (!std::ranges::equal(all[r].digest, all[0].digest))
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
