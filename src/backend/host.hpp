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

namespace moraine {

struct Host {
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
