# run_program(ARGUMENTS...): runs `program` with them, which must end with exit code 0 and without an error. Sets `output`.
function(run_program)
    execute_process(COMMAND ${program} ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE error)
    if(NOT code EQUAL 0 OR NOT error STREQUAL "")
        message(FATAL_ERROR "${ARGN}: expected exit code 0 and no error, got ${code}:\n${error}")
    endif()
    set(output "${output}" PARENT_SCOPE)
endfunction()
