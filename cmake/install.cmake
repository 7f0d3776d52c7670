# `cmake --install` puts the headers and a package there that `find_package(membrane)` finds, and `pkg-config membrane`.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(package_dir ${CMAKE_INSTALL_DATADIR}/cmake/membrane)

install(TARGETS membrane membrane_deterministic EXPORT membrane FILE_SET HEADERS)
install(DIRECTORY include/membrane DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN *.md)
install(EXPORT membrane NAMESPACE membrane:: FILE membrane-targets.cmake DESTINATION ${package_dir})

configure_package_config_file(cmake/membrane-config.cmake.in membrane-config.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(membrane-config-version.cmake COMPATIBILITY SameMinorVersion ARCH_INDEPENDENT)
install(
    FILES ${CMAKE_CURRENT_BINARY_DIR}/membrane-config.cmake ${CMAKE_CURRENT_BINARY_DIR}/membrane-config-version.cmake
        cmake/instantiated.cmake cmake/instantiated_double.cpp cmake/instantiated_float.cpp
    DESTINATION ${package_dir})
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/licenses/membrane)

# The folder of membrane.pc is known to pkg-config: what is installed may be moved.
set(pc_dir ${CMAKE_INSTALL_FULL_DATADIR}/pkgconfig)
cmake_path(RELATIVE_PATH CMAKE_INSTALL_PREFIX BASE_DIRECTORY ${pc_dir} OUTPUT_VARIABLE prefix_from_pc)
cmake_path(RELATIVE_PATH CMAKE_INSTALL_FULL_INCLUDEDIR BASE_DIRECTORY ${CMAKE_INSTALL_PREFIX}
    OUTPUT_VARIABLE include_from_prefix)
configure_file(cmake/membrane.pc.in membrane.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/membrane.pc DESTINATION ${CMAKE_INSTALL_DATADIR}/pkgconfig)

# The loop in one file: target `single_header`, and `cmake --install FOLDER --component single_header`.
if(PROJECT_IS_TOP_LEVEL)
    set(single_header ${PROJECT_BINARY_DIR}/membrane_single.hpp)
    add_custom_command(OUTPUT ${single_header}
        COMMAND ${CMAKE_COMMAND} -D OUTPUT=${single_header} -P ${CMAKE_CURRENT_LIST_DIR}/single_header.cmake
        DEPENDS ${headers} ${CMAKE_CURRENT_LIST_DIR}/single_header.cmake
        VERBATIM)
    add_custom_target(single_header DEPENDS ${single_header})
    install(FILES ${single_header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT single_header EXCLUDE_FROM_ALL)
endif()
