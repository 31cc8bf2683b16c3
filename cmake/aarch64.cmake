# Compiles for aarch64 on another processor, and runs what it compiled there by emulation (Debian: g++-aarch64-linux-gnu,
# qemu-user-static).
#   cmake -S . -B build-aarch64 -G Ninja --toolchain cmake/aarch64.cmake -DMORAINE_DEM_ONLY=ON
#   ninja -C build-aarch64 dem_bits && qemu-aarch64-static -L /usr/aarch64-linux-gnu build-aarch64/dem_bits
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64-static -L /usr/aarch64-linux-gnu)
