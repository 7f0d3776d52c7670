# `cmake --build FOLDER --target docs` writes the site to FOLDER/docs/html: the API, the pages and the examples. It needs no
# server: open index.html.
find_package(Doxygen QUIET)
find_package(Python3 QUIET COMPONENTS Interpreter)  # for the filter

if(DOXYGEN_FOUND AND Python3_FOUND)
    add_custom_target(docs
        COMMAND ${CMAKE_COMMAND} -E rm -rf ${PROJECT_BINARY_DIR}/docs
        COMMAND ${CMAKE_COMMAND} -E env MEMBRANE_ROOT=${PROJECT_SOURCE_DIR} MEMBRANE_TOOLS=${CMAKE_CURRENT_LIST_DIR}
            MEMBRANE_DOCS=${PROJECT_BINARY_DIR}/docs MEMBRANE_VERSION=${PROJECT_VERSION}
            $<TARGET_FILE:Doxygen::doxygen> ${CMAKE_CURRENT_LIST_DIR}/Doxyfile
        COMMENT "Writing docs/html/index.html"
        VERBATIM)
endif()
