# cmake -D program=FILE -D arguments=LIST -P refuses.cmake: the program does not take its last argument; it says so in one
# clear line, and its exit code is 2.
list(GET arguments -1 wrong)
execute_process(COMMAND ${program} ${arguments} RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE error)
if(NOT code EQUAL 2)
    message(FATAL_ERROR "expected exit code 2, got ${code}")
endif()
string(FIND "${error}" "${wrong}" found)
if(found EQUAL -1 OR NOT output STREQUAL "" OR NOT error MATCHES "^[^\n]+\n$")
    message(FATAL_ERROR "expected one line on stderr that names ${wrong}, got:\n${output}${error}")
endif()
