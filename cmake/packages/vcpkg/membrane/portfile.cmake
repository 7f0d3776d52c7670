# An overlay port of the source tree that it stands in: vcpkg install membrane --overlay-ports=cmake/packages/vcpkg
cmake_path(SET SOURCE_PATH NORMALIZE ${CMAKE_CURRENT_LIST_DIR}/../../../..)
set(VCPKG_BUILD_TYPE release)  # there are only headers

vcpkg_cmake_configure(SOURCE_PATH ${SOURCE_PATH}
    OPTIONS -DMEMBRANE_BUILD_TESTS=OFF -DMEMBRANE_BUILD_EXAMPLES=OFF -DMEMBRANE_BUILD_BENCHMARKS=OFF)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH share/cmake/membrane)
vcpkg_fixup_pkgconfig()
vcpkg_install_copyright(FILE_LIST ${SOURCE_PATH}/LICENSE)
