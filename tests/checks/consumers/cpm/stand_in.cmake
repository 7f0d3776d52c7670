# Not CPM.cmake, but a stand-in with the arguments of one call that CPM.cmake documents, that of a local source. It shows
# that the call is enough for this library, not that CPM.cmake does what it documents.
include(FetchContent)

macro(CPMAddPackage)
    cmake_parse_arguments(package "" "NAME;SOURCE_DIR" "" ${ARGN})
    if(package_UNPARSED_ARGUMENTS)
        message(FATAL_ERROR "the stand-in for CPM.cmake has no ${package_UNPARSED_ARGUMENTS}")
    endif()
    FetchContent_Declare(${package_NAME} SOURCE_DIR ${package_SOURCE_DIR})
    FetchContent_MakeAvailable(${package_NAME})
endmacro()
