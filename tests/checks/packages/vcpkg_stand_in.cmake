# cmake -D PORT=FOLDER -D SCRATCH=FOLDER -P vcpkg_stand_in.cmake
#
# Not vcpkg, but a stand-in for the functions that the portfile of PORT calls; installs to SCRATCH/prefix.
cmake_minimum_required(VERSION 3.23)

# must_exist(<file>...): below the prefix, or by its path.
function(must_exist)
    foreach(file IN LISTS ARGN)
        cmake_path(ABSOLUTE_PATH file BASE_DIRECTORY ${SCRATCH}/prefix)
        if(NOT EXISTS ${file})
            message(FATAL_ERROR "packages: there is no ${file}")
        endif()
    endforeach()
endfunction()

function(vcpkg_cmake_configure)
    cmake_parse_arguments(PARSE_ARGV 0 call "" SOURCE_PATH OPTIONS)
    execute_process(COMMAND_ERROR_IS_FATAL ANY COMMAND ${CMAKE_COMMAND} -G Ninja --warn-unused-vars
        -S ${call_SOURCE_PATH} -B ${SCRATCH}/build --install-prefix ${SCRATCH}/prefix ${call_OPTIONS})
endfunction()

function(vcpkg_cmake_install)
    execute_process(COMMAND_ERROR_IS_FATAL ANY COMMAND ${CMAKE_COMMAND} --install ${SCRATCH}/build)
endfunction()

function(vcpkg_cmake_config_fixup)
    cmake_parse_arguments(PARSE_ARGV 0 call "" CONFIG_PATH "")
    must_exist(${call_CONFIG_PATH}/membrane-config.cmake)
endfunction()

function(vcpkg_fixup_pkgconfig)
    must_exist(share/pkgconfig/membrane.pc)
endfunction()

function(vcpkg_install_copyright)
    cmake_parse_arguments(PARSE_ARGV 0 call "" "" FILE_LIST)
    must_exist(${call_FILE_LIST})
endfunction()

include(${PORT}/portfile.cmake)
