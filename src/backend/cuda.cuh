// The GPU as a place to compute; see host.hpp for the contract of each function.
//
// Several engines may share one card, each on a host thread of its own. Compiled with --default-stream
// per-thread, a launch or copy that names no stream goes to that of the calling thread and waits for no
// other. So one thread works an engine from the first array to the last, and nothing here waits for the whole
// card: memory comes from the card's pool, in the order of the stream, for cudaFree would.
#pragma once
#include <cstdint>
#include <cub/cub.cuh>
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
