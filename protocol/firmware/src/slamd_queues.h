/* What ports to a bare chip have alike: the queues that their interrupts fill and empty. SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * The source file of one port includes it, and defines before: SLAMD_ATOMIC, as in `SLAMD_ATOMIC { ... }`, which nothing interrupts and
 * no return leaves; SLAMD_ATOMIC_WORD, the same for one number of 32 bits; BYTE_US, the time of a byte on the line; START_SENDING(),
 * which is called when bytes wait. */
#ifndef SLAMD_QUEUES_H
#define SLAMD_QUEUES_H

#include "slamd_port.h"

static struct slamd_edge edges[64];
static volatile uint8_t edge_in, edge_out;
static volatile int32_t counts[2];

static uint8_t received[128];
static volatile uint8_t received_in, received_out;
static uint32_t delimiter_us[16];
static volatile uint8_t delimiter_in;
static uint8_t delimiter_out;

static uint8_t sending[1024];
static volatile uint16_t sending_in, sending_out;

bool slamd_port_next_edge(struct slamd_edge *edge) {
    uint8_t at = edge_out;
    if (at == edge_in) return false;
    *edge = edges[at];
    edge_out = (at + 1) & 63;
    return true;
}

void slamd_port_ticks(int32_t ticks[2]) {
    SLAMD_ATOMIC {
        ticks[0] = counts[0];
        ticks[1] = counts[1];
    }
}

bool slamd_port_receive(uint8_t *byte, uint32_t *t_us) {
    uint8_t at = received_out;
    if (at == received_in) return false;
    *byte = received[at];
    received_out = (at + 1) & 127;
    if (*byte == 0) {
        SLAMD_ATOMIC_WORD { *t_us = delimiter_us[delimiter_out++ & 15]; }
    }
    return true;
}

static uint16_t waiting(void) {
    uint16_t len;
    SLAMD_ATOMIC_WORD { len = (sending_in - sending_out) & 1023; }
    return len;
}

bool slamd_port_send(const uint8_t *bytes, uint16_t len) {
    uint16_t at = sending_in;
    if (len > 1023 - waiting()) return false;
    while (len--) {
        sending[at] = *bytes++;
        at = (at + 1) & 1023;
    }
    SLAMD_ATOMIC {
        sending_in = at;
        START_SENDING();
    }
    return true;
}

uint32_t slamd_port_send_delay_us(void) {
    return (uint32_t)waiting() * BYTE_US;
}

#endif
