// MORAINE_HD marks a function that runs on the host and on the GPU alike.
#pragma once
#ifdef __CUDACC__
#define MORAINE_HD __host__ __device__ inline
#else
#define MORAINE_HD inline
#endif
