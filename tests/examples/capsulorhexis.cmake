# cmake -D program=FILE -D folder=DIR -P capsulorhexis.cmake: the tear meets its beginning, the opening is round, and the
# picture is small and whole. In a viscous fluid the steps take at most 1 % of the hand's work.
include(${CMAKE_CURRENT_LIST_DIR}/run_program.cmake)

file(REMOVE_RECURSE ${folder})
run_program(--out ${folder})
if(NOT output MATCHES "^capsule, [^;]* circularity ([0-9.]+); ")
    message(FATAL_ERROR "expected the circularity of the opening:\n${output}")
endif()
if(NOT CMAKE_MATCH_1 GREATER 0.9 OR CMAKE_MATCH_1 GREATER 1)
    message(FATAL_ERROR "expected a circularity of 0.9 to 1:\n${output}")
endif()

set(svg ${folder}/capsulorhexis.svg)
file(SIZE ${svg} size)
file(READ ${svg} text)
string(REGEX MATCHALL "<circle " tools "${text}")
list(LENGTH tools count)
if(size GREATER 300000 OR NOT count EQUAL 2 OR NOT text MATCHES "^<svg .*</svg>\n$" OR text MATCHES "nan|inf[^o]")
    message(FATAL_ERROR "${svg} is not a small drawing with forceps in two of three states: ${size} bytes, ${count} tools")
endif()

run_program(--out ${folder}/fluid --tick 5e-4 --drag 3e-3 --sweeps 6)
if(NOT output MATCHES "([0-9.]+) by the fluid . ([0-9.]+) by slip in the forceps . (-?[0-9.]+) % by the steps")
    message(FATAL_ERROR "expected the energies in a fluid:\n${output}")
endif()
if(NOT CMAKE_MATCH_1 GREATER 10 OR NOT CMAKE_MATCH_2 GREATER 10 OR CMAKE_MATCH_3 LESS -1 OR CMAKE_MATCH_3 GREATER 1)
    message(FATAL_ERROR "expected that fluid and slip take energy, and the steps at most 1 %:\n${output}")
endif()
