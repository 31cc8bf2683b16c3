// Processes that work on one bed, each with memory of its own: ranks 0 to size() - 1, as MPI has them. What
// sends messages is a module beside the program, mpi_ranks.cpp, which is loaded only where mpirun started it;
// tests have one that sends them between threads.
//
// Of two messages from one rank to another with one tag, the first sent is the first received. One thread of
// a rank at a time may call.
#pragma once
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "error.hpp"
#include "memory.hpp"

namespace moraine {

// What a message is about.
enum class Tag : int { command, parcel, ghosts, wanted, rows, shares, displacements, pushes, gathered };

class Ranks {
 public:
  // A message on its way, whose bytes stay where they are until it is done.
  struct Message {
    std::uintptr_t request = 0;  // the sender's own; 0: none
    std::size_t bytes = 0;       // that have come, once it is done
  };

  virtual ~Ranks() = default;
  virtual int rank() const = 0;
  virtual int size() const = 0;
  virtual int on_this_host() const = 0;  // ranks, this one included

  virtual Message send(int to, Tag tag, const void* bytes, std::size_t count) = 0;
  virtual Message receive(int from, Tag tag, void* bytes, std::size_t most) = 0;
  virtual bool done(Message& message) = 0;

  // Each rank's stretch of `all`, bytes begin[rank] to begin[rank + 1], to all others.
  virtual void gather(void* all, const std::vector<std::size_t>& begin);
  // From rank 0 to all others.
  virtual void broadcast(void* bytes, std::size_t count);

  // Ends all ranks at once, where one alone cannot go on.
  [[noreturn]] virtual void abort(const std::string& words) = 0;

  void wait(Message& message);          // spins, then lets others run
  void wait_at_rest(Message& message);  // the same for long waits, and then sleeps in between
};

// The ranks of this process's world, where mpirun (or srun) started it on more than one; else null. Throws
// Error where it did and the program has no MPI.
std::unique_ptr<Ranks> connect_ranks();

// Bytes of several kinds one after the other, which rank sends to rank as a whole, however many.
class Parcel {
 public:
  template <class T>
  void put(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    put(&value, 1);
  }
  template <class T>
  void put(const T* values, std::size_t count) {
    const auto* first = reinterpret_cast<const std::byte*>(values);
    bytes_.insert(bytes_.end(), first, first + count * sizeof(T));
  }
  // All of a list, or a stretch of it; empty lists stay empty.
  template <class T>
  void put_list(const std::vector<T>& list, std::size_t first, std::size_t end) {
    const std::size_t count = list.empty() ? 0 : end - first;
    put(count), put(list.data() + (list.empty() ? 0 : first), count);
  }
  template <class T>
  void put_list(const std::vector<T>& list) {
    put_list(list, 0, list.size());
  }

  template <class T>
  void get(T& value) {
    std::memcpy(static_cast<void*>(&value), bytes_.data() + at_, sizeof value), at_ += sizeof value;
  }
  template <class T>
  void add_to(std::vector<T>& list) {
    std::size_t count = 0;
    get(count);
    list.resize(list.size() + count);
    if (count == 0) return;
    std::memcpy(static_cast<void*>(list.data() + (list.size() - count)), bytes_.data() + at_,
                count * sizeof(T));
    at_ += count * sizeof(T);
  }

  // On its way until wait(); the parcel stays where it is.
  void post(Ranks& ranks, int to);
  void wait(Ranks& ranks);
  void send(Ranks& ranks, int to) { post(ranks, to), wait(ranks); }
  static Parcel from(Ranks& ranks, int from, bool at_rest = false);

 private:
  std::vector<std::byte> bytes_;
  std::size_t at_ = 0, size_ = 0;
  std::vector<Ranks::Message> messages_;
};

// The number that rank 0 has.
template <class T>
T of_rank_0(Ranks* ranks, T value) {
  if (ranks) ranks->broadcast(&value, sizeof value);
  return value;
}
// The number of each rank, in their order.
template <class T>
std::vector<T> of_all(Ranks& ranks, const T& value) {
  std::vector<T> all(ranks.size());
  std::vector<std::size_t> begin;
  for (std::size_t k = 0; k <= all.size(); ++k) begin.push_back(k * sizeof(T));
  all[ranks.rank()] = value;
  ranks.gather(all.data(), begin);
  return all;
}

// One that all ranks throw together, so that they still understand each other.
class SharedError : public Error {
 public:
  using Error::Error;
};
// Throws on all ranks the words of the first that has some. ranks: null where there are no others.
void expect_well(Ranks* ranks, const std::string& words);
// The same for what `act` throws.
template <class Act>
void on_all_ranks(Ranks* ranks, Act&& act);

template <class Act>
void on_all_ranks(Ranks* ranks, Act&& act) {
  if (!ranks) return act();
  std::string words;
  try {
    act();
  } catch (const std::exception& e) {
    words = in_words(e);
  }
  expect_well(ranks, words);
}

}  // namespace moraine
