// Ranks (src/ranks/ranks.hpp) that are threads of one process, to test what several ranks do without MPI.
#pragma once
#include <atomic>
#include <cstring>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "dem/ranks/ranked_engine.hpp"

namespace moraine {

// Messages on their way, by where they come from, where they go, and tag. Bytes stay with the sender until
// they are taken, as with a large message of MPI: who waits for a message to go while the other does so, too,
// waits for ever, and who changes it meanwhile sends something else.
class PostOffice {
 public:
  using Key = std::tuple<int, int, Tag>;
  using Taken = std::shared_ptr<std::atomic<bool>>;
  Taken put(const Key& key, const void* bytes, std::size_t count) {
    const std::lock_guard held(mutex_);
    ++messages_;
    return boxes_[key].emplace_back(Letter{bytes, count, std::make_shared<std::atomic<bool>>(false)}).taken;
  }
  bool take(const Key& key, void* bytes, std::size_t most, std::size_t& count) {
    const std::lock_guard held(mutex_);
    auto& box = boxes_[key];
    if (box.empty()) return false;
    const Letter letter = box.front();
    count = letter.count;
    if (count > most)
      throw std::logic_error("a message of tag " + std::to_string(int(std::get<2>(key))) + " has " +
                             std::to_string(count) + " bytes, " + std::to_string(most) + " were expected");
    std::memcpy(bytes, letter.bytes, count);
    letter.taken->store(true);
    box.pop_front();
    return true;
  }
  std::int64_t messages() {
    const std::lock_guard held(mutex_);
    return messages_;
  }
  bool empty() {
    const std::lock_guard held(mutex_);
    for (const auto& [key, box] : boxes_)
      if (!box.empty()) return false;
    return true;
  }

 private:
  struct Letter {
    const void* bytes;
    std::size_t count;
    Taken taken;
  };
  std::mutex mutex_;
  std::map<Key, std::deque<Letter>> boxes_;
  std::int64_t messages_ = 0;
};

class ThreadRank final : public Ranks {
 public:
  ThreadRank(PostOffice& office, int rank, int size) : office_(office), rank_(rank), size_(size) {}
  int rank() const override { return rank_; }
  int size() const override { return size_; }
  int on_this_host() const override { return size_; }
  Message send(int to, Tag tag, const void* bytes, std::size_t count) override {
    sent_[++last_] = office_.put({rank_, to, tag}, bytes, count);
    return {last_, 0};
  }
  Message receive(int from, Tag tag, void* bytes, std::size_t most) override {
    expected_[++last_] = {{from, rank_, tag}, bytes, most};
    return {last_, 0};
  }
  bool done(Message& message) override {
    if (const auto sent = sent_.find(message.request); sent != sent_.end()) {
      if (!sent->second->load()) return false;
      sent_.erase(sent);
    } else if (const auto at = expected_.find(message.request); at != expected_.end()) {
      const Expected& e = at->second;
      if (!office_.take(e.key, e.bytes, e.most, message.bytes)) return false;
      expected_.erase(at);
    }
    message.request = 0;
    return true;
  }
  void abort(const std::string& words) override { throw std::logic_error("rank aborts: " + words); }

 private:
  struct Expected {
    PostOffice::Key key;
    void* bytes;
    std::size_t most;
  };
  PostOffice& office_;
  int rank_, size_;
  std::map<std::uintptr_t, PostOffice::Taken> sent_;
  std::map<std::uintptr_t, Expected> expected_;
  std::uintptr_t last_ = 0;
};

// So many ranks, of which all but the first serve.
class ServingRanks {
 public:
  explicit ServingRanks(int ranks) {
    for (int r = 0; r < ranks; ++r) ranks_.push_back(std::make_unique<ThreadRank>(office_, r, ranks));
    for (int r = 1; r < ranks; ++r) serving_.emplace_back([this, r] { dem::serve(*ranks_[r]); });
  }
  ~ServingRanks() {
    dem::dismiss(*ranks_[0]);
    for (std::thread& t : serving_) t.join();
  }
  Ranks& first() { return *ranks_[0]; }
  bool all_have_come() { return office_.empty(); }        // whether no message was sent for nothing
  std::int64_t messages() { return office_.messages(); }  // so far

 private:
  PostOffice office_;
  std::vector<std::unique_ptr<ThreadRank>> ranks_;
  std::vector<std::thread> serving_;
};

// The first rank's engine.
class EngineOnRanks : public ServingRanks {
 public:
  EngineOnRanks(int ranks, int threads)
      : ServingRanks(ranks), engine_(dem::make_ranked_engine(first(), threads)) {}
  dem::Engine& operator*() const { return *engine_; }
  dem::Engine* operator->() const { return engine_.get(); }

 private:
  std::unique_ptr<dem::Engine> engine_;
};

}  // namespace moraine
