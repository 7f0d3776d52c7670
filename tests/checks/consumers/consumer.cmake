# What each consumer expects of the library it got, and the program it makes of it.

foreach(property COMPILE_OPTIONS COMPILE_DEFINITIONS LINK_OPTIONS)
    get_target_property(forced membrane::membrane INTERFACE_${property})
    if(forced)
        message(FATAL_ERROR "membrane::membrane forces ${property} on its users: ${forced}")
    endif()
endforeach()

foreach(unasked membrane_tests membrane_examples membrane_benchmarks membrane_warnings)
    if(TARGET ${unasked})
        message(FATAL_ERROR "${unasked} is there without being requested")
    endif()
endforeach()

if(NOT TARGET membrane::deterministic)
    message(FATAL_ERROR "membrane::deterministic is missing")
endif()

add_executable(consumer ../main.cpp)
target_link_libraries(consumer PRIVATE membrane::membrane)
