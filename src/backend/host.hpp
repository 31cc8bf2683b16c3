// The host as a place to compute: memory, loops over an index, scan and sort. cuda.cuh gives the same for the
// GPU, so that code templated on Space runs on either.
#pragma once
#include <algorithm>
#include <cstdint>
#include <memory>
#include <new>
#include <numeric>
#include <vector>

#include "backend/host_device.hpp"
#include "backend/team.hpp"

namespace moraine {

struct Host {
  // One of several blocks of threads that work in step, as a body of cooperate() sees it. Here a block is one
  // thread.
  class Team {
   public:
    Team(int block, int blocks, int items, Barrier& barrier)
        : block_(block), blocks_(blocks), items_(items), barrier_(barrier) {}
    int block() const { return block_; }
    int blocks() const { return blocks_; }

    // f(k) for each k < count, on one thread each.
    template <class F>
    void for_each(int count, F&& f) const {
      for (int k = 0; k < count; ++k) f(k);
    }

    // An item of work that a few threads do together, its lanes.
    struct Item {
      static constexpr int lanes = 1;
      int index, lane;
      // Whether it is so for any of those that go through a loop together.
      bool any(bool so) const { return so; }
      // use(value of lane 0), use(value of lane 1), ... on each of them.
      template <class T, class Use>
      void in_order(const T& mine, Use&& use) const {
        use(mine);
      }
    };
    // f(item) for each index < count; items_at_once() of them have threads of their own.
    template <class F>
    void for_each_item(int count, F&& f) const {
      for (int k = 0; k < count; ++k) f(Item{k, 0});
    }
    int items_at_once() const { return items_; }

    void sync() const {}  // of a block
    // f() on one thread of the block, between two sync().
    template <class F>
    void once(F&& f) const {
      f();
    }
    void barrier() const { barrier_.wait(); }  // of all blocks

   private:
    int block_, blocks_, items_;
    Barrier& barrier_;
  };

  template <class T>
  class Array {
   public:
    Array() = default;
    Array(Array&&) noexcept = default;
    Array& operator=(Array&&) noexcept = default;

    // Contents are undefined after a change of size.
    void resize(std::int64_t n) {
      if (n > capacity_) {
        capacity_ = n + n / 4;
        data_.reset(static_cast<T*>(::operator new[](capacity_ * sizeof(T), alignment)));
      }
      size_ = n;
    }
    std::int64_t size() const { return size_; }
    T* data() const { return data_.get(); }
    void set(const std::vector<T>& v) {
      resize(static_cast<std::int64_t>(v.size()));
      std::copy(v.begin(), v.end(), data());
    }
    std::vector<T> get() const { return {data(), data() + size_}; }

   private:
    static constexpr std::align_val_t alignment{64};
    struct Free {
      void operator()(T* p) const { ::operator delete[](p, alignment); }
    };
    std::unique_ptr<T[], Free> data_;
    std::int64_t size_ = 0, capacity_ = 0;
  };

  int threads = 1;

  template <class Body>
  void for_each(std::int64_t n, const Body& body) const {
#pragma omp parallel for schedule(static) num_threads(threads)
    for (std::int64_t i = 0; i < n; ++i) body(i);
  }

  // body(team, shared) on several blocks at once, each with memory of its own that its threads share,
  // in any state. There is work for so many units; a block takes one or several at once, of `unit` items.
  template <class Body>
  void cooperate(std::int64_t units, int unit, const Body& body) const {
    const int blocks = static_cast<int>(std::clamp<std::int64_t>(units, 1, threads));
    Barrier barrier(blocks);
    run_team(blocks, [&](int block) {
      Team team(block, blocks, unit, barrier);
      typename Body::Shared shared;
      body(team, shared);
    });
  }

  // out[k] = in[0] + ... + in[k - 1]
  void exclusive_scan(const std::int64_t* in, std::int64_t* out, std::int64_t n) const {
    std::exclusive_scan(in, in + n, out, std::int64_t{0});
  }

  // Stable sort of values by keys in [0, key_end).
  void sort_by_key(Array<std::int32_t>& keys, Array<std::int32_t>& values, std::int32_t key_end) const {
    const std::int64_t n = keys.size();
    std::vector<std::int64_t> first(key_end + 1, 0);
    for (std::int64_t i = 0; i < n; ++i) ++first[keys.data()[i] + 1];
    for (std::int32_t k = 0; k < key_end; ++k) first[k + 1] += first[k];
    Array<std::int32_t> k_out, v_out;
    k_out.resize(n), v_out.resize(n);
    for (std::int64_t i = 0; i < n; ++i) {
      const std::int64_t at = first[keys.data()[i]]++;
      k_out.data()[at] = keys.data()[i];
      v_out.data()[at] = values.data()[i];
    }
    keys = std::move(k_out), values = std::move(v_out);
  }

  template <class T>
  T read(const T* p) const {
    return *p;
  }
  template <class T>
  void write(T* p, const T& value) const {
    *p = value;
  }
};

}  // namespace moraine
