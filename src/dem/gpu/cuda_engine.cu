#include "backend/cuda.cuh"
#include "dem/gpu/gather_engine.hpp"

namespace moraine::dem {

bool cuda_device_found() {
  int devices = 0;
  return cudaGetDeviceCount(&devices) == cudaSuccess && devices > 0;
}

std::unique_ptr<Engine> make_cuda_engine() {
  cudaDeviceProp card;
  cuda_check(cudaGetDeviceProperties(&card, 0), "device properties");
  keep_memory_pool(0);
  return std::make_unique<gpu::GatherEngine<Cuda>>(Cuda{}, std::string("cuda, ") + card.name);
}

}  // namespace moraine::dem
