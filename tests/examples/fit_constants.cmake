# cmake -D program=FILE -D data=DIR -D folder=DIR -P fit_constants.cmake: the example finds the constants that its table
# was made with, 25 and 3 N/m, draws them, says what a short table does not determine, and refuses what is no table.
file(REMOVE_RECURSE ${folder})
file(MAKE_DIRECTORY ${folder})
execute_process(COMMAND ${program} --data ${data}/lens_indentation.csv --out ${folder}
    RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE error)
if(NOT code EQUAL 0 OR NOT error STREQUAL "" OR output MATCHES "not converged")
    message(FATAL_ERROR "expected exit code 0 and a fit, got ${code}:\n${output}${error}")
endif()
foreach(expected "springs;25" "foundation;3")
    list(GET expected 0 name)
    list(GET expected 1 truth)
    if(NOT output MATCHES "${name}  ?\\[N/m\\] +[0-9.]+ +([0-9.]+) to +([0-9.]+) +yes")
        message(FATAL_ERROR "${name} is not identifiable:\n${output}")
    endif()
    if(NOT (CMAKE_MATCH_1 LESS truth AND truth LESS CMAKE_MATCH_2))
        message(FATAL_ERROR "the interval of ${name} does not hold ${truth}:\n${output}")
    endif()
endforeach()
file(READ ${folder}/fit_constants.svg svg)
string(REGEX MATCHALL "<use xlink:href='#gpPt6'" dots "${svg}")
list(LENGTH dots count)
if(NOT count EQUAL 13 OR NOT svg MATCHES "^<svg .*</svg>\n$" OR svg MATCHES "nan|inf[^o]")
    message(FATAL_ERROR "expected a drawing of 12 rows and a legend, got ${count} dots")
endif()

# Without gnuplot the data are written, and it is said what is missing.
file(REMOVE ${folder}/fit_constants.dat ${folder}/fit_constants.svg)
execute_process(COMMAND ${CMAKE_COMMAND} -E env PATH=/nonexistent ${program} --out ${folder} RESULT_VARIABLE code OUTPUT_VARIABLE output)
if(NOT code EQUAL 0 OR NOT output MATCHES "\nno picture, gnuplot is missing; data: ${folder}/fit_constants.dat\n$"
    OR NOT EXISTS ${folder}/fit_constants.dat OR EXISTS ${folder}/fit_constants.svg)
    message(FATAL_ERROR "expected data and no picture, exit code ${code}:\n${output}")
endif()

# From three shallow presses, springs and foundation are not identifiable.
file(WRITE ${folder}/shallow.csv "1e-5,2.0e-5\n2e-5,4.1e-5\n\n# no more\n3e-5,6.1e-5\n")
execute_process(COMMAND ${program} --data ${folder}/shallow.csv --out ${folder} RESULT_VARIABLE code OUTPUT_VARIABLE output)
if(NOT code EQUAL 0 OR NOT output MATCHES " no\n")
    message(FATAL_ERROR "a shallow table determines all constants, exit code ${code}:\n${output}")
endif()

file(WRITE ${folder}/empty.csv "")
file(WRITE ${folder}/words.csv "depth,force\n0.1,strong\n")
file(WRITE ${folder}/columns.csv "1e-4,1e-3,2\n")
file(WRITE ${folder}/pulls.csv "1e-4,1e-3\n2e-4,-1e-3\n3e-4,3e-3\n")
foreach(bad empty words columns pulls)
    execute_process(COMMAND ${program} --data ${folder}/${bad}.csv --out ${folder}
        RESULT_VARIABLE code OUTPUT_QUIET ERROR_VARIABLE error)
    if(NOT code EQUAL 2 OR NOT error MATCHES "^fit_constants: [^\n]+\n$")
        message(FATAL_ERROR "${bad}: expected one line and exit code 2, got ${code}:\n${error}")
    endif()
endforeach()
