// SPDX-License-Identifier: MIT
// A position of a device in millimetres where metres are meant.
// expect: Millimetre
// expect: no match for|invalid operands|no viable
#include <membrane/haptics/units.hpp>

membrane::Metres moved(const membrane::Metres& place, const membrane::Millimetres& displacement) {
#ifdef CORRECT
    return place + membrane::in_metres(displacement);
#else
    return place + displacement;
#endif
}
