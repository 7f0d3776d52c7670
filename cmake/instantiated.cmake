# membrane::instantiated: the library's headers, and their usual types compiled once for float and double, by the compiler
# and with the flags of the project that links it. Built only where it is linked.
#
#     target_link_libraries(my_simulator PRIVATE membrane::instantiated)
#
# In builds without optimisation it is optimised all the same, so that a loop runs in real time under a debugger; any -O
# in the project's own flags is kept. Flags that choose an instruction set (-march=native) must be the whole project's.
if(TARGET membrane::instantiated)
    return()
endif()
add_library(membrane_instantiated STATIC EXCLUDE_FROM_ALL
    ${CMAKE_CURRENT_LIST_DIR}/instantiated_double.cpp ${CMAKE_CURRENT_LIST_DIR}/instantiated_float.cpp)
add_library(membrane::instantiated ALIAS membrane_instantiated)
target_compile_definitions(membrane_instantiated PUBLIC MEMBRANE_INSTANTIATED)
target_link_libraries(membrane_instantiated PUBLIC membrane::membrane PRIVATE membrane::deterministic)
set_target_properties(membrane_instantiated PROPERTIES POSITION_INDEPENDENT_CODE ON)
string(TOUPPER "${CMAKE_BUILD_TYPE}" build_type)
if(NOT "${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${build_type}}" MATCHES "(^| )[-/]O")
    target_compile_options(membrane_instantiated PRIVATE $<$<CXX_COMPILER_ID:GNU,Clang,AppleClang>:-O2>)
endif()
