// What passes between the ranks that share a bed (ranks.hpp).
//
// At a search a rank gets from later ones the grains that may be near its own, and keeps as ghosts those that
// it has pairs with. In each step then, with each rank that it shares pairs with:
//
//   rows    x, v and omega of the ghosts, from their owner to the earlier rank, once they are at the step
//   shares  of the near pairs, by link and slot, from the earlier rank to the owner, once all its chunks with
//           ghosts have done their pairs
//   totals  of each chunk, to all, once grains have moved on; then all go on to the next step
//
// Pairs without ghosts need not wait for rows, nor chunks that no earlier rank knows for shares: messages
// pass in that time. Only one thread of a rank, its first, sends and receives.
#pragma once
#include <atomic>
#include <memory>
#include <vector>

#include "dem/cpu/bed.hpp"
#include "ranks/ranks.hpp"

namespace moraine::dem::cpu {

class Traffic {
 public:
  explicit Traffic(Ranks& ranks) : ranks_(ranks) {}
  ~Traffic() { finish(); }
  Traffic(const Traffic&) = delete;
  Traffic& operator=(const Traffic&) = delete;

  // At a search, in this order; on all ranks together. Throws Error on all of them if a coordinate is not
  // finite.
  void fetch_ghosts(Bed& bed);                  // all that may be near
  std::vector<Outgoing> keep_ghosts(Bed& bed);  // those of candidates; returns links from earlier ranks
  void lay_out(const Bed& bed);                 // for the steps to come, once bed.links is made
  const std::vector<double>& work() const { return work_; }  // of each rank, in pairs, at the last search

  // In a step. One thread, unless said otherwise.
  void begin(Bed& bed, std::int64_t step);     // own grains are at the step
  void progress(Bed& bed, std::int64_t step);  // what can be done without waiting
  bool is_over(std::int64_t step) const {
    return sent_shares_ == later_.size() && has_shares(step) && has_rows(step);
  }
  // Any thread: whether they are here; that a chunk with ghosts has done its pairs.
  bool has_rows(std::int64_t step) const { return rows_at_.load(std::memory_order_acquire) == step; }
  bool has_shares(std::int64_t step) const { return shares_at_.load(std::memory_order_acquire) == step; }
  void pairs_done() { chunks_done_.fetch_add(1, std::memory_order_release); }

  // Tallies of this step of all chunks, into bed.tallies; whether a grain is lost on any rank. All ranks
  // together.
  bool share_tallies(Bed& bed, const BodyMotion& bodies, std::int64_t step);
  void count_work(const Bed& bed);  // all ranks together

  std::size_t bytes_sent() const { return bytes_sent_; }  // so far, of rows and shares

 private:
  // A rank whose grains this one has as ghosts.
  struct Later {
    int rank;
    Index first_ghost = 0, ghosts = 0;  // rows of the bed
    std::vector<Index> links;           // that go there
    std::vector<double> rows;
    std::vector<std::byte> shares;
    Ranks::Message rows_in, shares_out;
    bool has_rows = false;
  };
  // A rank that has ghosts of this one's grains.
  struct Earlier {
    int rank;
    std::vector<Index> wanted;        // rows of the bed
    Index first_link = 0, links = 0;  // that come from there
    std::vector<double> rows;
    std::vector<std::byte> shares;
    Ranks::Message rows_out, shares_in;
    bool has_shares = false;
  };

  void finish();  // waits until what was sent in the last step has gone
  void take_rows(Bed& bed, Later& from);
  void send_shares(const Bed& bed, Later& to);
  void take_shares(Bed& bed, Earlier& from);

  Ranks& ranks_;
  std::vector<Later> later_;
  std::vector<Earlier> earlier_;
  std::vector<double> work_;
  int numbers_ = 9;  // of a ghost's row that the law needs
  int chunks_with_ghosts_ = 0;
  std::atomic<int> chunks_done_{0};
  std::atomic<std::int64_t> rows_at_{-1}, shares_at_{-1};
  std::size_t sent_shares_ = 0, bytes_sent_ = 0;
};

}  // namespace moraine::dem::cpu
