// For bench/scaling: what MPI and the pieces of a step take that `moraine bench` does not show, in s, as one
// line of JSON.
//
//   mpirun -n 2 times    one way of a message of 8 bytes and of 1 MB; an isend and an irecv without waiting;
//   a gather of all to all
//
// The pieces are written after src/dem/cpu/ghosts.cpp (CellSet::has_near), traffic.cpp (rows, tallies) and
// bed.cpp (sums).
#include <mpi.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <vector>

namespace {

// s of one of so many calls; the least of five turns
template <class Act>
double seconds(int times, Act&& act) {
  double least = 1e9;
  for (int turn = 0; turn < 5; ++turn) {
    const auto began = std::chrono::steady_clock::now();
    for (int k = 0; k < times; ++k) act(k);
    least = std::min(least,
                     std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count() / times);
  }
  return least;
}

volatile double sink;

double one_way(int rank, std::vector<char>& bytes, int count, int times) {
  return 0.5 * seconds(times, [&](int) {
           MPI_Status status;
           if (rank == 0) {
             MPI_Send(bytes.data(), count, MPI_BYTE, 1, 0, MPI_COMM_WORLD);
             MPI_Recv(bytes.data(), count, MPI_BYTE, 1, 0, MPI_COMM_WORLD, &status);
           } else if (rank == 1) {
             MPI_Recv(bytes.data(), count, MPI_BYTE, 0, 0, MPI_COMM_WORLD, &status);
             MPI_Send(bytes.data(), count, MPI_BYTE, 0, 0, MPI_COMM_WORLD);
           }
         });
}

double gather(int size, std::vector<char>& bytes, int all, int times) {
  std::vector<int> counts(size, all / size), first(size);
  for (int r = 0; r < size; ++r) first[r] = r * (all / size);
  return seconds(times, [&](int) {
    MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_BYTE, bytes.data(), counts.data(), first.data(), MPI_BYTE,
                   MPI_COMM_WORLD);
  });
}

// A look for a grain's cell and those beside it in another rank's, where it has none of them.
double look() {
  constexpr int n = 40, grains = 100'000;
  const std::vector<std::uint64_t> bits((n * n * n + 63) / 64);
  std::vector<double> x(3 * grains);
  std::uint64_t random = 1;
  for (double& value : x)
    random = random * 6364136223846793005u + 1442695040888963407u, value = (random >> 11) * 0x1p-53;
  int found = 0;
  const double s = seconds(1, [&](int) {
    for (int i = 0; i < grains; ++i) {
      int low[3], high[3];
      for (int a = 0; a < 3; ++a) {
        const int c = static_cast<int>(x[3 * i + a] * n);
        low[a] = a < 2 ? c - 1 : std::max(c - 1, 0), high[a] = a < 2 ? c + 1 : std::min(c + 1, n - 1);
      }
      for (int k = low[2]; k <= high[2]; ++k)
        for (int j = low[1]; j <= high[1]; ++j)
          for (int c = low[0]; c <= high[0]; ++c) {
            volatile int side = n;  // a number that the compiler does not know, as there
            const int cell = ((k + side) % side * side + (j + side) % side) * side + (c + side) % side;
            found += bits[cell / 64] >> (cell % 64) & 1;
          }
    }
  });
  sink = found;
  return s / grains;
}

struct alignas(64) Tally {
  double force[4], lost[2], fastest2[3], ways2[2];
};
// Numbers of a chunk put into its tally, and the sums of the bed from it: two servos and what is lost.
double tally() {
  constexpr int chunks = 100'000, of_chunk = 4;
  std::vector<double> all(of_chunk * chunks, 1.0);
  std::vector<Tally> tallies(chunks);
  const double s = seconds(3, [&](int) {
    const double* from = all.data();
    for (Tally& t : tallies)
      std::memcpy(t.force, from, 16), std::memcpy(t.lost, from + 2, 16), from += of_chunk;
    for (int k = 0; k < of_chunk; ++k) {
      double sum = 0;
      for (const Tally& t : tallies) sum += k < 2 ? t.force[k] : t.lost[k - 2];
      sink = sum;
    }
    double most = 0;
    for (const Tally& t : tallies) most = std::max({most, t.fastest2[0], t.fastest2[1], t.fastest2[2]});
    sink = most;
  });
  return s / chunks;
}

// A ghost's row, 72 bytes of 128, out of rows that lie apart.
double row() {
  constexpr int rows = 90'000, wanted = 3'000, numbers = 9;
  std::vector<double> grain(16 * rows, 1.0), to(numbers * wanted);
  std::uint64_t random = 1;
  std::vector<int> list(wanted);
  for (int& i : list)
    random = random * 6364136223846793005u + 1442695040888963407u,
    i = static_cast<int>((random >> 33) % rows);
  std::sort(list.begin(), list.end());
  const double s = seconds(20, [&](int) {
    double* at = to.data();
    for (const int i : list) {
      const double* g = grain.data() + 16 * i;
      std::memcpy(at, g, 24), std::memcpy(at + 3, g + 4, 24), std::memcpy(at + 6, g + 8, 24), at += numbers;
    }
    sink = to[0];
  });
  return s / wanted;
}

}  // namespace

int main(int count, char** words) {
  MPI_Init(&count, &words);
  int rank = 0, size = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank), MPI_Comm_size(MPI_COMM_WORLD, &size);
  constexpr int large = 1 << 20, small = 4'000, middling = 40'000;
  std::vector<char> bytes(2 * large);
  const double short_way = one_way(rank, bytes, 8, 10'000), long_way = one_way(rank, bytes, large, 200);
  const double tiny_gather = gather(size, bytes, 16 * size, 5'000),
               small_gather = gather(size, bytes, small, 5'000),
               middling_gather = gather(size, bytes, middling, 2'000),
               large_gather = gather(size, bytes, large, 200);
  double posting = 0;
  if (size > 1) {
    constexpr int times = 200;
    std::vector<MPI_Request> requests(2 * times);
    const int other = rank ^ 1;
    posting =
        seconds(1,
                [&](int) {
                  for (int k = 0; k < times; ++k) {
                    MPI_Irecv(bytes.data() + 8 * k, 8, MPI_BYTE, other, 0, MPI_COMM_WORLD, &requests[2 * k]);
                    MPI_Isend(bytes.data() + large, 8, MPI_BYTE, other, 0, MPI_COMM_WORLD,
                              &requests[2 * k + 1]);
                  }
                  MPI_Waitall(2 * times, requests.data(), MPI_STATUSES_IGNORE);
                }) /
        times;
  }
  MPI_Barrier(MPI_COMM_WORLD);
  if (rank == 0)
    std::printf(
        "{\"latency\": %.3e, \"bandwidth\": %.3e, \"posting\": %.3e, \"gather\": {\"%d\": %.3e, \"%d\": "
        "%.3e, \"%d\": %.3e, "
        "\"%d\": %.3e}, \"look\": %.3e, \"tally\": %.3e, \"row\": %.3e}\n",
        short_way, large / (long_way - short_way), posting, 16 * size, tiny_gather, small, small_gather,
        middling, middling_gather, large, large_gather, look(), tally(), row());
  MPI_Finalize();
}
