# membrane_mesh_file: how the examples read meshes, compiled once; for examples and tests.
include_guard(GLOBAL)

find_package(assimp REQUIRED)
find_path(MEMBRANE_TINYOBJLOADER tiny_obj_loader.h REQUIRED)

add_library(membrane_mesh_file STATIC EXCLUDE_FROM_ALL
    ${CMAKE_CURRENT_LIST_DIR}/mesh_file.cpp ${CMAKE_CURRENT_LIST_DIR}/mesh_syntax.cpp ${CMAKE_CURRENT_LIST_DIR}/ply_syntax.cpp)
cmake_path(GET CMAKE_CURRENT_LIST_DIR PARENT_PATH examples)
target_include_directories(membrane_mesh_file PUBLIC ${examples})
target_include_directories(membrane_mesh_file SYSTEM PRIVATE ${MEMBRANE_TINYOBJLOADER})
target_link_libraries(membrane_mesh_file PUBLIC membrane::deterministic PRIVATE membrane_warnings assimp::assimp)
