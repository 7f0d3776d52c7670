# Programs of this project: tests, examples, benchmarks. Users get none of these flags.

add_library(membrane_warnings INTERFACE)
target_compile_options(membrane_warnings INTERFACE
    $<$<CXX_COMPILER_ID:GNU,Clang,AppleClang>:-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow>)

# membrane_program(<name> <source>...): an executable with the library, the warnings and the includes of its folder.
function(membrane_program name)
    add_executable(${name} ${ARGN})
    target_link_libraries(${name} PRIVATE membrane::deterministic membrane_warnings)
    target_include_directories(${name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
endfunction()
