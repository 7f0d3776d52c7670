# cmake -D program=FILE -D script=CSV -D folder=DIR -P own_force_policy.cmake: plays a script from a file, and refuses
# one that is none.
execute_process(COMMAND ${program} --script ${script} RESULT_VARIABLE code OUTPUT_VARIABLE output)
if(NOT code EQUAL 0 OR NOT output MATCHES "at the limit")
    message(FATAL_ERROR "the script was not played to the device's limit:\n${output}")
endif()

file(MAKE_DIRECTORY ${folder})
file(WRITE ${folder}/empty.csv "")
file(WRITE ${folder}/words.csv "time,x,y,z\n0,0,zero,0\n")
file(WRITE ${folder}/backwards.csv "1,0,0,0\n0,0,0,0\n")
foreach(bad no_such_file.csv empty.csv words.csv backwards.csv)
    execute_process(COMMAND ${program} --script ${folder}/${bad} RESULT_VARIABLE code OUTPUT_QUIET ERROR_VARIABLE error)
    if(NOT code EQUAL 2 OR NOT error MATCHES "^own_force_policy: [^\n]+\n$")
        message(FATAL_ERROR "${bad}: expected one line and exit code 2, got ${code}:\n${error}")
    endif()
endforeach()
