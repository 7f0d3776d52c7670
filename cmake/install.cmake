# `cmake --install` puts the headers and a package there that `find_package(membrane)` finds.
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
