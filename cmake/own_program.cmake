# Programs of this project: tests, examples, benchmarks. Users get none of these flags.

add_library(membrane_warnings INTERFACE)
target_compile_options(membrane_warnings INTERFACE
    $<$<CXX_COMPILER_ID:GNU,Clang,AppleClang>:-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow>)

option(MEMBRANE_USUAL_TYPES "Compile once what most programs are made of: they build sooner, and run slower" OFF)
if(MEMBRANE_USUAL_TYPES)
    set(folder ${PROJECT_SOURCE_DIR}/tests/support)
    add_library(membrane_usual_types STATIC ${folder}/usual_double.cpp ${folder}/usual_float.cpp)
    # Only its precompiled header leaves the types to the libraries: what is compiled with other options does without.
    target_link_libraries(membrane_usual_types
        INTERFACE $<LINK_ONLY:membrane::instantiated> PRIVATE membrane::deterministic membrane_warnings)
    target_precompile_headers(membrane_usual_types PRIVATE ${folder}/usual_types.hpp)
endif()

# Fewer collections of garbage: a tenth of the time of g++, for more memory.
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    string(APPEND CMAKE_CXX_FLAGS " --param=ggc-min-expand=100 --param=ggc-min-heapsize=1000000")
    if(MEMBRANE_USUAL_TYPES)  # a tenth less again, for what tests gain little from
        target_compile_options(membrane_warnings INTERFACE -w)  # a tenth, too
        foreach(pass tree-pta tree-dominator-opts ivopts if-conversion if-conversion2 shrink-wrap tree-sink tree-slsr
                tree-bit-ccp branch-count-reg reorder-blocks cprop-registers split-wide-types)
            string(APPEND CMAKE_CXX_FLAGS " -fno-${pass}")
        endforeach()
    endif()
endif()

# membrane_program(<name> <source>...): an executable with the library, the warnings and the includes of its folder.
function(membrane_program name)
    add_executable(${name} ${ARGN})
    target_link_libraries(${name} PRIVATE membrane::deterministic membrane_warnings)
    target_include_directories(${name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
    if(MEMBRANE_USUAL_TYPES)
        target_link_libraries(${name} PRIVATE membrane_usual_types)
        target_precompile_headers(${name} REUSE_FROM membrane_usual_types)
    endif()
endfunction()
