# `cpack -G TGZ` in the build directory: a tarball that runs where nothing of what Moraine needs is installed, on Linux
# with a C library no older than this machine's. bin/moraine looks for its libraries in ../lib and for the table of units in
# ../share/udunits; what belongs to the system stays out (C library, driver of the GPU).

find_path(UDUNITS2_TABLE udunits2.xml
          PATHS /usr/share /usr/local/share PATH_SUFFIXES xml/udunits udunits DOC "directory of udunits2.xml" REQUIRED)

# Not RUNPATH, which would leave the libraries of libraries to the system.
target_link_options(moraine PRIVATE -Wl,--disable-new-dtags)
set_target_properties(moraine PROPERTIES INSTALL_RPATH "$ORIGIN/../lib")
install(TARGETS moraine RUNTIME_DEPENDENCIES
  PRE_EXCLUDE_REGEXES "^(ld-linux.*|lib(c|m|dl|rt|pthread|resolv|util|nss_.*|cuda|nvidia-.*))\\.so"
  RUNTIME DESTINATION bin LIBRARY DESTINATION lib)
install(DIRECTORY ${UDUNITS2_TABLE}/ DESTINATION share/udunits FILES_MATCHING PATTERN "udunits2*.xml")
install(DIRECTORY cases DESTINATION .
  PATTERN output EXCLUDE PATTERN sweep EXCLUDE PATTERN runs EXCLUDE PATTERN .snakemake EXCLUDE)
install(DIRECTORY completions docs DESTINATION .)
install(FILES README.md LICENSE CITATION.cff DESTINATION .)

set(CPACK_GENERATOR TGZ)
set(CPACK_PACKAGE_FILE_NAME "moraine-${PROJECT_VERSION}-${CMAKE_SYSTEM_NAME}-${CMAKE_SYSTEM_PROCESSOR}")
if(MORAINE_CUDA)
  string(APPEND CPACK_PACKAGE_FILE_NAME "-cuda")
endif()
include(CPack)
