// The GPU as a place to compute; see host.hpp for the contract of each function.
#pragma once
#include <cstdint>
#include <cub/cub.cuh>
#include <vector>

#include "error.hpp"

namespace moraine {

inline void cuda_check(cudaError_t status, const char* what) {
  if (status != cudaSuccess) throw error("CUDA: ", what, ": ", cudaGetErrorString(status));
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
    ~Array() { cudaFree(data_); }

    void resize(std::int64_t n) {
      if (n > capacity_) {
        cudaFree(data_);
        data_ = nullptr, capacity_ = n + n / 4;
        cuda_check(cudaMalloc(&data_, capacity_ * sizeof(T)), "memory for the grains");
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
