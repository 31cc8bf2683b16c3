// For bench/scaling: stands before MPI's library (LD_PRELOAD) and counts what a rank sends: on MPI_Finalize
// one line a rank on stderr,
//   counted RANK, messages and bytes of each tag, gathers NUMBER BYTES SECONDS
// The tags are those of src/ranks/ranks.hpp, in their order.
#include <mpi.h>
#include <stdio.h>

enum { tags = 9 };
static long messages[tags], bytes[tags], gathers, gathered;
static double seconds;

int MPI_Isend(const void* buffer, int count, MPI_Datatype type, int to, int tag, MPI_Comm comm,
              MPI_Request* request) {
  if (tag >= 0 && tag < tags) ++messages[tag], bytes[tag] += count;
  return PMPI_Isend(buffer, count, type, to, tag, comm, request);
}

int MPI_Allgatherv(const void* own, int count, MPI_Datatype type, void* all, const int* counts,
                   const int* first, MPI_Datatype to, MPI_Comm comm) {
  int size;
  MPI_Comm_size(comm, &size);
  ++gathers, gathered += first[size - 1] + counts[size - 1];
  const double began = MPI_Wtime();
  const int result = PMPI_Allgatherv(own, count, type, all, counts, first, to, comm);
  seconds += MPI_Wtime() - began;
  return result;
}

int MPI_Finalize(void) {
  int rank;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  char line[1024];
  int at = snprintf(line, sizeof line, "counted %d", rank);
  for (int t = 0; t < tags; ++t)
    at += snprintf(line + at, sizeof line - at, " %ld %ld", messages[t], bytes[t]);
  fprintf(stderr, "%s gathers %ld %ld %.6f\n", line, gathers, gathered, seconds);
  return PMPI_Finalize();
}
