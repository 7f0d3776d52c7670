# cmake -D program=FILE -P soft_tissue.cmake: the engine's sphere stays closed at its seam; each command does what it says.
execute_process(COMMAND ${program} RESULT_VARIABLE code OUTPUT_VARIABLE output)
if(NOT code EQUAL 0)
    message(FATAL_ERROR "expected exit code 0, got ${code}")
endif()
string(REGEX MATCH "pressed +([0-9.]+) mN, (0\\.[89][0-9]+) mm" found "${output}")
set(force "${CMAKE_MATCH_1}")
set(displaced "${CMAKE_MATCH_2}")
foreach(line "pressed +[1-9][0-9]+\\.[0-9] mN" "teleported +0\\.0 mN, 0\\.0" "paused +0\\.0 mN, ${displaced} mm"
        "loaded +${force} mN, ${displaced} mm" "refused +0\\.0 mN, ${displaced} mm"
        "reset +0\\.0 mN, 0\\.000 mm")
    set(status advanced)
    if(line MATCHES "^refused")
        set(status invalid_input)
    endif()
    if(NOT output MATCHES "${line}[^\n]*seam open by 0\\.000 mm, ${status}\n")
        message(FATAL_ERROR "found no line like '${line}' with a closed seam and '${status}':\n${output}")
    endif()
endforeach()
