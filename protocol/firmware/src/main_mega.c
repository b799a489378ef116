/* main, for builds without the Arduino core. SPDX-License-Identifier: MIT OR Apache-2.0 */
#if defined(__AVR_ATmega2560__) && !defined(ARDUINO)
#include "slamd_ring.h"

int main(void) {
    slamd_ring_begin();
    for (;;) slamd_ring_poll();
}
#endif
