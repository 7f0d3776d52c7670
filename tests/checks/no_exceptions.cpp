// SPDX-License-Identifier: MIT
#include <cstdlib>
#include <cstring>

#include <membrane/membrane.hpp>

// Without exceptions, bad input reaches the handler, with its message.
int main() {
    membrane::set_invalid_input_handler([](const char* message) {
        std::exit(std::strstr(message, "radius") != nullptr ? EXIT_SUCCESS : EXIT_FAILURE);
    });
    (void)membrane::icosphere<double>({.radius = -0.01, .subdivisions = 2});
    return EXIT_FAILURE;
}
