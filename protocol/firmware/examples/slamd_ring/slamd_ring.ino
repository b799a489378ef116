// The whole firmware. SPDX-License-Identifier: MIT OR Apache-2.0
// Do not use Serial here: the library drives the serial port itself.
#include <slamd_ring.h>

void setup() { slamd_ring_begin(); }

void loop() { slamd_ring_poll(); }
