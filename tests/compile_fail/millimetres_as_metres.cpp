// SPDX-License-Identifier: MIT
// A position of a device in millimetres where metres are meant.
// expect: Millimetre
// expect: no match for|invalid operands|no viable
#include "../../examples/openhaptics/units.hpp"

examples::Metres moved(const examples::Metres& place, const examples::Millimetres& displacement) {
#ifdef CORRECT
    return place + examples::in_metres(displacement);
#else
    return place + displacement;
#endif
}
