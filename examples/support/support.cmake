# membrane_example_support: code shared by the examples, compiled once: readers of meshes and of the command line.
include_guard(GLOBAL)

find_package(assimp REQUIRED)
find_package(CLI11 REQUIRED)
find_path(MEMBRANE_TINYOBJLOADER tiny_obj_loader.h REQUIRED)

add_library(membrane_example_support STATIC EXCLUDE_FROM_ALL
    ${CMAKE_CURRENT_LIST_DIR}/command_line.cpp ${CMAKE_CURRENT_LIST_DIR}/specimen.cpp
    ${CMAKE_CURRENT_LIST_DIR}/mesh_file.cpp ${CMAKE_CURRENT_LIST_DIR}/mesh_syntax.cpp)
cmake_path(GET CMAKE_CURRENT_LIST_DIR PARENT_PATH examples)
target_include_directories(membrane_example_support PUBLIC ${examples})
target_include_directories(membrane_example_support SYSTEM PRIVATE ${MEMBRANE_TINYOBJLOADER})
target_link_libraries(membrane_example_support PUBLIC membrane::deterministic PRIVATE membrane_warnings assimp::assimp CLI11::CLI11)
