// MORAINE_HD marks a function that runs on the host and on the GPU alike, MORAINE_TEAM one that a team of
// threads runs together (Team in host.hpp and cuda.cuh): in one compilation always on the same side.
#pragma once
#ifdef __CUDACC__
#define MORAINE_HD __host__ __device__ inline
#define MORAINE_TEAM __device__ inline
#else
#define MORAINE_HD inline
#define MORAINE_TEAM inline
#endif
