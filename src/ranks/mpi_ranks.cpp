// The module moraine_mpi.so: ranks.hpp by MPI.
#include <mpi.h>

#include <cstdlib>
#include <iostream>
#include <limits>

#include "ranks/ranks.hpp"

namespace moraine {

namespace {

static_assert(sizeof(MPI_Request) <= sizeof(std::uintptr_t));

int in_int(std::size_t bytes) {
  if (bytes > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw error("internal: a message of ", bytes, " bytes is longer than MPI can count");
  return static_cast<int>(bytes);
}

class MpiRanks final : public Ranks {
 public:
  MpiRanks() {
    int provided = 0;
    MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
    if (provided < MPI_THREAD_FUNNELED) throw error("this MPI cannot be used from a program with threads");
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &size_);
    MPI_Comm host;
    MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &host);
    MPI_Comm_size(host, &on_this_host_);
    MPI_Comm_free(&host);
  }
  ~MpiRanks() override { MPI_Finalize(); }

  int rank() const override { return rank_; }
  int size() const override { return size_; }
  int on_this_host() const override { return on_this_host_; }

  Message send(int to, Tag tag, const void* bytes, std::size_t count) override {
    MPI_Request request;
    MPI_Isend(bytes, in_int(count), MPI_BYTE, to, static_cast<int>(tag), MPI_COMM_WORLD, &request);
    return kept(request);
  }
  Message receive(int from, Tag tag, void* bytes, std::size_t most) override {
    MPI_Request request;
    MPI_Irecv(bytes, in_int(most), MPI_BYTE, from, static_cast<int>(tag), MPI_COMM_WORLD, &request);
    return kept(request);
  }
  bool done(Message& message) override {
    if (message.request == 0) return true;
    MPI_Request request;
    std::memcpy(&request, &message.request, sizeof request);
    int done = 0;
    MPI_Status status;
    MPI_Test(&request, &done, &status);
    if (!done) return false;
    int bytes = 0;
    MPI_Get_count(&status, MPI_BYTE, &bytes);
    message = {};
    message.bytes = static_cast<std::size_t>(bytes);
    return true;
  }

  void gather(void* all, const std::vector<std::size_t>& begin) override {
    std::vector<int> counts(size_), first(size_);
    for (int r = 0; r < size_; ++r) counts[r] = in_int(begin[r + 1] - begin[r]), first[r] = in_int(begin[r]);
    MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_BYTE, all, counts.data(), first.data(), MPI_BYTE, MPI_COMM_WORLD);
  }
  void broadcast(void* bytes, std::size_t count) override {
    MPI_Bcast(bytes, in_int(count), MPI_BYTE, 0, MPI_COMM_WORLD);
  }
  void abort(const std::string& words) override {
    std::cerr << "moraine: rank " << rank_ << ": " << words << std::endl;
    MPI_Abort(MPI_COMM_WORLD, 1);
    std::_Exit(1);
  }

 private:
  static Message kept(MPI_Request request) {
    Message message;
    std::memcpy(&message.request, &request, sizeof request);
    return message;
  }

  int rank_ = 0, size_ = 1, on_this_host_ = 1;
};

}  // namespace

}  // namespace moraine

extern "C" moraine::Ranks* moraine_ranks() { return new moraine::MpiRanks; }
