# MORAINE_PORTABLE: all code but the command line and the Python module goes into libmoraine.so, which is there twice,
#   lib/libmoraine.so                              for x86-64-v2 (SSE4.2)
#   lib/glibc-hwcaps/x86-64-v3/libmoraine.so       for x86-64-v3 (AVX2, FMA), with the loop over pairs for AVX-512 as well
# and the loader of the C library (glibc 2.33 or later) takes the second where the processor has what it takes. As each has
# all inline functions it calls (-Bsymbolic-functions), none of one instruction set gets into the other.

set(rooms moraine_dem moraine_coupling moraine_output moraine_case moraine_run)
if(MORAINE_FLUID)
  list(APPEND rooms moraine_fluid)
endif()

foreach(level v2 v3)
  set(library moraine_${level})
  add_library(${library} SHARED src/processor.cpp)
  foreach(room IN LISTS rooms)
    get_target_property(sources ${room} SOURCES)
    target_sources(${library} PRIVATE ${sources})
    target_include_directories(${library} PUBLIC $<TARGET_PROPERTY:${room},INCLUDE_DIRECTORIES>)
    target_compile_definitions(${library} PRIVATE $<TARGET_PROPERTY:${room},COMPILE_DEFINITIONS>)
    get_target_property(libraries ${room} LINK_LIBRARIES)
    list(REMOVE_ITEM libraries ${rooms} moraine_options)
    target_link_libraries(${library} PRIVATE ${libraries})
  endforeach()
  target_link_libraries(${library} PUBLIC moraine_options)
  target_compile_options(${library} PRIVATE -march=x86-64-${level})
  target_link_options(${library} PRIVATE -Wl,-Bsymbolic-functions -Wl,--disable-new-dtags)
  set_target_properties(${library} PROPERTIES OUTPUT_NAME moraine)
endforeach()

set_target_properties(moraine_v2 PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib INSTALL_RPATH "$ORIGIN")
set_target_properties(moraine_v3 PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib/glibc-hwcaps/x86-64-v3
                      INSTALL_RPATH "$ORIGIN/../..")
target_compile_definitions(moraine_v2 PRIVATE MORAINE_NEEDS_SSE4)
target_compile_definitions(moraine_v3 PRIVATE MORAINE_WIDE)
target_sources(moraine_v3 PRIVATE src/dem/cpu/pair_forces_wide.cpp)
set_target_properties(${rooms} PROPERTIES EXCLUDE_FROM_ALL ON)
add_dependencies(moraine moraine_v3)
