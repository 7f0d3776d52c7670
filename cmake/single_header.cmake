# cmake -D OUTPUT=FILE [-D "HEADERS=HEADER;..."] -P cmake/single_header.cmake
#
# Writes HEADERS (membrane/membrane.hpp), and the headers of the library that they include, into one file: each once, in
# the order in which a compiler sees them. Includes of Eigen and of the standard library stay where they are, so that what
# stands under a condition still does. Comments stay too: who has one file alone has no other place to read units and
# preconditions.
cmake_minimum_required(VERSION 3.23)

if(NOT HEADERS)
    set(HEADERS membrane/membrane.hpp)
endif()
set(include_dir ${CMAKE_CURRENT_LIST_DIR}/../include)

# emit(<text>): at the end of the file to be written.
function(emit text)
    set_property(GLOBAL APPEND_STRING PROPERTY single_header "${text}")
endfunction()

# expand(<header>): it, and before each rest of it what it includes there.
function(expand header)
    get_property(expanded GLOBAL PROPERTY expanded_headers)
    if(header IN_LIST expanded)
        return()
    endif()
    set_property(GLOBAL APPEND PROPERTY expanded_headers ${header})
    file(READ ${include_dir}/${header} rest)
    string(REGEX REPLACE "^// SPDX[^\n]*\n#pragma once\n+" "" rest "${rest}")
    while(rest MATCHES "#include <(membrane/[^>]+)>\n")
        string(FIND "${rest}" "${CMAKE_MATCH_0}" begin)
        string(LENGTH "${CMAKE_MATCH_0}" length)
        string(SUBSTRING "${rest}" 0 ${begin} before)
        math(EXPR begin "${begin} + ${length}")
        string(SUBSTRING "${rest}" ${begin} -1 rest)
        emit("${before}")
        expand(${CMAKE_MATCH_1})
    endwhile()
    emit("\n// ${header}\n${rest}")
endfunction()

emit("// SPDX-License-Identifier: MIT\n#pragma once\n")
foreach(header IN LISTS HEADERS)
    expand(${header})
endforeach()
get_property(text GLOBAL PROPERTY single_header)
string(REGEX REPLACE "\n\n\n+" "\n\n" text "${text}")
file(WRITE ${OUTPUT} "${text}")
