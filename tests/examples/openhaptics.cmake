# cmake -D program=FILE -P openhaptics.cmake: on the test double, in real time, the hand presses the membrane and feels it;
# a device that is not there ends in one line.
execute_process(COMMAND ${program} --seconds 1.5 RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE error)
if(NOT code EQUAL 0 OR NOT output MATCHES "^([0-9]+) ticks, .*at most ([0-9.]+) N\nno force: 0 for errors [^\n]* 0 for ")
    message(FATAL_ERROR "expected ticks and no errors, got ${code}:\n${output}${error}")
endif()
if(CMAKE_MATCH_1 LESS 100 OR CMAKE_MATCH_2 LESS 0.02 OR CMAKE_MATCH_2 GREATER 3.3)
    message(FATAL_ERROR "expected to feel something:\n${output}")
endif()
execute_process(COMMAND ${program} --device "none such" RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE error)
if(NOT code EQUAL 2 OR NOT error MATCHES "^openhaptics: OpenHapticsDevice: cannot open the device: [^\n]+\n$")
    message(FATAL_ERROR "expected one line, got ${code}:\n${output}${error}")
endif()
