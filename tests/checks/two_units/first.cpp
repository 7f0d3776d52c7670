// SPDX-License-Identifier: MIT
#include "all_headers.hpp"

const void* address_in_second_unit();

// A variable that is `inline` has one address in the whole program.
int main() { return address_in_second_unit() == &membrane::detail::assert_handler ? 0 : 1; }
