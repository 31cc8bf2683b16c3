# What is installed, in components:
#   program    bin/moraine, libmoraine.so of portable builds, and the table of units in share/udunits
#   libraries  in lib, those that the program needs, but what belongs to the system (C library, driver of the GPU)
#   cases      cases and completions
#   docs       README and the like
#   python     the module _core, beside which the Python package puts its files;  mpi  the module for several ranks
# `pip install .` takes program, python, cases and mpi into the package (pyproject.toml), .ci/wheel adds the libraries by
# auditwheel. `cpack -G TGZ` in the build directory makes a tarball of the first four. It runs where nothing of what Moraine
# needs is installed, on Linux with a C library no older than this machine's.

# Not RUNPATH, which would leave the libraries of libraries to the system.
target_link_options(moraine PRIVATE -Wl,--disable-new-dtags)
set_target_properties(moraine PROPERTIES INSTALL_RPATH "$ORIGIN/../lib")
install(TARGETS moraine RUNTIME_DEPENDENCY_SET needed RUNTIME DESTINATION bin COMPONENT program)
if(MORAINE_PORTABLE)
  install(TARGETS moraine_v2 RUNTIME_DEPENDENCY_SET needed LIBRARY DESTINATION lib COMPONENT program)
  install(TARGETS moraine_v3 LIBRARY DESTINATION lib/glibc-hwcaps/x86-64-v3 COMPONENT program)
endif()
install(RUNTIME_DEPENDENCY_SET needed
  PRE_EXCLUDE_REGEXES "^(ld-linux.*|lib(c|m|dl|rt|pthread|resolv|util|nss_.*|cuda|nvidia-.*|moraine))\\.so"
  LIBRARY DESTINATION lib COMPONENT libraries)
install(DIRECTORY ${UDUNITS2_TABLE}/ DESTINATION share/udunits COMPONENT program FILES_MATCHING PATTERN "udunits2*.xml")

install(DIRECTORY cases DESTINATION . COMPONENT cases
  PATTERN output EXCLUDE PATTERN sweep EXCLUDE PATTERN runs EXCLUDE PATTERN .snakemake EXCLUDE)
install(DIRECTORY completions DESTINATION . COMPONENT cases)
install(DIRECTORY docs DESTINATION . COMPONENT docs)
install(FILES README.md LICENSE CITATION.cff DESTINATION . COMPONENT docs)

if(TARGET _core)
  target_link_options(_core PRIVATE -Wl,--disable-new-dtags)
  set_target_properties(_core PROPERTIES INSTALL_RPATH "$ORIGIN/lib")
  install(TARGETS _core LIBRARY DESTINATION . COMPONENT python EXCLUDE_FROM_ALL)
endif()
if(TARGET moraine_mpi)  # of this machine's MPI, and thus for this machine only
  install(TARGETS moraine_mpi LIBRARY DESTINATION bin COMPONENT mpi EXCLUDE_FROM_ALL)
endif()

if(SKBUILD AND NOT MORAINE_PORTABLE)  # by pip, for this machine: where libraries were found, there they are
  set_target_properties(moraine _core PROPERTIES INSTALL_RPATH_USE_LINK_PATH ON)
endif()

set(CPACK_GENERATOR TGZ)
set(CPACK_PACKAGE_FILE_NAME "moraine-${PROJECT_VERSION}-${CMAKE_SYSTEM_NAME}-${CMAKE_SYSTEM_PROCESSOR}")
if(MORAINE_CUDA)
  string(APPEND CPACK_PACKAGE_FILE_NAME "-cuda")
endif()
include(CPack)
