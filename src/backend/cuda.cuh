// The GPU as a place to compute; see host.hpp for the contract of each function.
//
// Several engines may share one card, each on a host thread of its own. Compiled with --default-stream
// per-thread, a launch or copy that names no stream goes to that of the calling thread and waits for no
// other. So one thread works an engine from the first array to the last, and nothing here waits for the whole
// card: memory comes from the card's pool, in the order of the stream, for cudaFree would.
#pragma once
#include <cooperative_groups.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cub/cub.cuh>
#include <memory>
#include <vector>

#include "error.hpp"

#if !defined(__CUDA_ARCH__) && !defined(CUDA_API_PER_THREAD_DEFAULT_STREAM)
#error "compile with --default-stream per-thread"
#endif

namespace moraine {

inline void cuda_check(cudaError_t status, const char* what) {
  if (status != cudaSuccess) throw error("CUDA: ", what, ": ", cudaGetErrorString(status));
}

// The pool keeps what is given back to it; by default it would return it to the driver at every
// synchronisation.
inline void keep_memory_pool(int device) {
  cudaMemPool_t pool;
  cuda_check(cudaDeviceGetDefaultMemPool(&pool, device), "memory pool");
  std::uint64_t kept = UINT64_MAX;
  cuda_check(cudaMemPoolSetAttribute(pool, cudaMemPoolAttrReleaseThreshold, &kept), "memory pool");
}

template <class Body>
__global__ void for_each_kernel(std::int64_t n, const __grid_constant__ Body body) {
  const std::int64_t i = blockIdx.x * static_cast<std::int64_t>(blockDim.x) + threadIdx.x;
  if (i < n) body(i);
}

// Four lanes to an item: a grain has some seven neighbours, and 10,000 grains with four lanes each just fill
// an H100.
class CudaTeam {
 public:
  static constexpr int most_threads = 384;  // of a block
  // Ten numbers for each thread, so that rows begin at different banks of memory.
  struct alignas(16) Slot {
    double number[10];
  };

  __device__ explicit CudaTeam(Slot* slots) : slots_(slots) {}
  __device__ int block() const { return static_cast<int>(blockIdx.x); }
  __device__ int blocks() const { return static_cast<int>(gridDim.x); }

  template <class F>
  __device__ void for_each(int count, F&& f) const {
    for (int k = thread(); k < count; k += threads()) f(k);
  }

  struct Item {
    static constexpr int lanes = 4;
    int index, lane;
    unsigned together;  // the threads of this warp that have items, as a mask
    Slot* slot;         // of lane 0

    __device__ bool any(bool so) const { return __any_sync(together, so); }
    template <class T, class Use>
    __device__ void in_order(const T& mine, Use&& use) const {
      static_assert(sizeof(T) <= sizeof(Slot) && alignof(T) <= alignof(Slot));
      *reinterpret_cast<T*>(slot + lane) = mine;
      __syncwarp(together);
      for (int k = 0; k < lanes; ++k) use(*reinterpret_cast<const T*>(slot + k));
      __syncwarp(together);
    }
  };
  template <class F>
  __device__ void for_each_item(int count, F&& f) const {
    constexpr int warp = 32, lanes = Item::lanes;
    const int lane = thread() % lanes;
    for (int k = thread() / lanes; k < count; k += items_at_once()) {
      const int left = (count - k) * lanes + thread() % warp - lane;  // threads from the first of this warp
      f(Item{k, lane, left < warp ? (1u << left) - 1 : ~0u, slots_ + thread() - lane});
    }
  }
  __device__ int items_at_once() const { return threads() / Item::lanes; }

  __device__ void sync() const { __syncthreads(); }
  template <class F>
  __device__ void once(F&& f) const {
    sync();
    if (thread() == 0) f();
    sync();
  }
  __device__ void barrier() const { cooperative_groups::this_grid().sync(); }

 private:
  __device__ int thread() const { return static_cast<int>(threadIdx.x); }
  __device__ int threads() const { return static_cast<int>(blockDim.x); }
  Slot* slots_;
};

template <class Body>
__global__ void __launch_bounds__(CudaTeam::most_threads)
    cooperate_kernel(const __grid_constant__ Body body) {
  using Shared = typename Body::Shared;
  __shared__ CudaTeam::Slot slots[CudaTeam::most_threads];
  __shared__ alignas(16) unsigned char shared[sizeof(Shared)];
  body(CudaTeam(slots), *reinterpret_cast<Shared*>(shared));
}

struct Cuda {
  template <class T>
  class Array {
   public:
    Array() = default;
    Array(Array&& other) noexcept { swap(other); }
    Array& operator=(Array&& other) noexcept {
      swap(other);
      return *this;
    }
    ~Array() { free(); }

    void resize(std::int64_t n) {
      if (n > capacity_) {
        free();
        const std::int64_t wanted = n + n / 4;
        cuda_check(cudaMallocAsync(reinterpret_cast<void**>(&data_), wanted * sizeof(T), cudaStreamPerThread),
                   "memory for the grains");
        capacity_ = wanted;
      }
      size_ = n;
    }
    std::int64_t size() const { return size_; }
    T* data() const { return data_; }
    void set(const std::vector<T>& v) {
      resize(static_cast<std::int64_t>(v.size()));
      cuda_check(cudaMemcpy(data_, v.data(), v.size() * sizeof(T), cudaMemcpyHostToDevice),
                 "copy to the GPU");
    }
    std::vector<T> get() const {
      std::vector<T> v(size_);
      cuda_check(cudaMemcpy(v.data(), data_, size_ * sizeof(T), cudaMemcpyDeviceToHost), "copy from the GPU");
      return v;
    }

   private:
    void free() {
      if (data_) cudaFreeAsync(data_, cudaStreamPerThread);
      data_ = nullptr, capacity_ = 0;
    }
    void swap(Array& other) {
      std::swap(data_, other.data_), std::swap(size_, other.size_), std::swap(capacity_, other.capacity_);
    }
    T* data_ = nullptr;
    std::int64_t size_ = 0, capacity_ = 0;
  };

  template <class Body>
  void for_each(std::int64_t n, const Body& body) const {
    if (n == 0) return;
    constexpr int block = 128;
    for_each_kernel<<<static_cast<unsigned>((n + block - 1) / block), block>>>(n, body);
    cuda_check(cudaGetLastError(), "kernel launch");
  }

  // All blocks of such a launch run at once; it waits until they have room. So each engine takes only its
  // share of the multiprocessors. The fewer blocks, the cheaper the barrier: one on each, that takes all
  // units in one turn, or where that is too much, of the size that gets most threads to run.
  template <class Body>
  void cooperate(std::int64_t units, int unit, const Body& body) const {
    const auto kernel = cooperate_kernel<Body>;
    const int unit_threads = unit * CudaTeam::Item::lanes;
    const auto units_on_each = [&](int units_at_once) {
      int blocks = 0;
      cuda_check(
          cudaOccupancyMaxActiveBlocksPerMultiprocessor(&blocks, kernel, units_at_once * unit_threads, 0),
          "room for blocks");
      return blocks * units_at_once;
    };
    int processors = 0;
    cuda_check(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, 0), "multiprocessors");
    processors = std::max(1, processors / engines_.load());

    const int most = CudaTeam::most_threads / unit_threads;
    int at_once = static_cast<int>(std::min<std::int64_t>((units + processors - 1) / processors, most + 1));
    if (at_once > most) {
      at_once = most;
      for (int k = most - 1; k > 0; --k)
        if (units_on_each(k) > units_on_each(at_once)) at_once = k;
    }
    const std::int64_t wanted = (units + at_once - 1) / at_once,
                       room = static_cast<std::int64_t>(units_on_each(at_once)) / at_once * processors;
    Body argument = body;
    void* arguments[] = {&argument};
    cuda_check(cudaLaunchCooperativeKernel(kernel, static_cast<unsigned>(std::min(wanted, room)),
                                           static_cast<unsigned>(at_once * unit_threads), arguments, 0,
                                           cudaStreamPerThread),
               "kernel launch");
  }

  void exclusive_scan(const std::int64_t* in, std::int64_t* out, std::int64_t n) const {
    with_scratch([&](void* scratch, std::size_t& bytes) {
      return cub::DeviceScan::ExclusiveSum(scratch, bytes, in, out, n);
    });
  }

  void sort_by_key(Array<std::int32_t>& keys, Array<std::int32_t>& values, std::int32_t) const {
    Array<std::int32_t> k_out, v_out;
    k_out.resize(keys.size()), v_out.resize(values.size());
    with_scratch([&](void* scratch, std::size_t& bytes) {
      return cub::DeviceRadixSort::SortPairs(scratch, bytes, keys.data(), k_out.data(), values.data(),
                                             v_out.data(), keys.size());
    });
    keys = std::move(k_out), values = std::move(v_out);
  }

  template <class T>
  T read(const T* p) const {
    T value;
    cuda_check(cudaMemcpy(&value, p, sizeof(T), cudaMemcpyDeviceToHost), "copy from the GPU");
    return value;
  }
  template <class T>
  void write(T* p, const T& value) const {
    cuda_check(cudaMemcpy(p, &value, sizeof(T), cudaMemcpyHostToDevice), "copy to the GPU");
  }

 private:
  // Engines that live on the card: each takes its share of the multiprocessors.
  static inline std::atomic<int> engines_{0};
  std::shared_ptr<void> counted_{(++engines_, nullptr), [](void*) { --engines_; }};

  // CUB's two calls: how much scratch memory, then the work.
  template <class Call>
  void with_scratch(Call&& call) const {
    std::size_t bytes = 0;
    cuda_check(call(nullptr, bytes), "scratch size");
    Array<char> scratch;
    scratch.resize(static_cast<std::int64_t>(bytes) + 1);
    cuda_check(call(scratch.data(), bytes), "scan or sort");
  }
};

}  // namespace moraine
