/* The ring on a simulated board: a script on stdin sets its clock, sensors, wheels and motors; the bytes
 * that it sends go to stdout. */
#include "slamd_motors.h"
#include "slamd_port.h"
#include "slamd_ring.h"
#include <stdio.h>
#include <string.h>

enum { STEP_US = 25, RISE_US = 450, MUTE = 0, STUCK = -1, NEVER_FALLS = -2 };

const char slamd_port_board[] = "paper";
static uint32_t now_us, last_levels, fired_us[32];
static long mode[32];
static bool fired[32];
static uint8_t memory[96], heard[65536], pins[2];
static uint32_t heard_in, heard_out;
static int32_t counts[2];
static bool line_busy, emergency, held[2];
static int16_t duties[2];
static double speed_mm_s[2], way_mm[2];

void slamd_port_begin(void) {}
void slamd_port_rest(void) {}
uint32_t slamd_port_now_us(void) { return now_us; }
uint32_t slamd_port_levels(void) {
    uint32_t levels = 0;
    for (int i = 0; i < 32; i++) {
        uint32_t since_us = now_us - fired_us[i];
        bool high = mode[i] == STUCK;
        if (fired[i] && mode[i] != MUTE && since_us >= RISE_US)
            high = high || mode[i] == NEVER_FALLS || since_us < RISE_US + (uint32_t)mode[i];
        if (high) levels |= (uint32_t)1 << i;
    }
    return levels;
}
bool slamd_port_next_edge(struct slamd_edge *edge) {
    uint32_t levels = slamd_port_levels();
    if (levels == last_levels) return false;
    last_levels = levels;
    edge->t_us = now_us;
    edge->levels = levels;
    return true;
}
void slamd_port_trigger(uint8_t lines) {
    for (int i = 0; i < 32; i++) {
        if (lines >> (i % 8) & 1) fired[i] = true, fired_us[i] = now_us;
    }
}
void slamd_port_ticks(int32_t ticks[2]) { memcpy(ticks, counts, sizeof counts); }
bool slamd_port_receive(uint8_t *byte, uint32_t *t_us) {
    if (heard_out == heard_in) return false;
    *byte = heard[heard_out++ % sizeof heard];
    *t_us = now_us;
    return true;
}
bool slamd_port_send(const uint8_t *bytes, uint16_t len) {
    if (line_busy) return false;
    for (uint16_t i = 0; i < len; i++) printf("%02x", bytes[i]);
    return true;
}
uint32_t slamd_port_send_delay_us(void) { return 85; }
uint8_t slamd_port_load(uint8_t at) { return memory[at]; }
bool slamd_port_store(uint8_t at, uint8_t byte) { memory[at] = byte; return true; }

bool slamd_port_has_motors(void) { return true; }
void slamd_port_uid(uint8_t uid[8]) { (void)uid; }
void slamd_port_motors(const int16_t duty[2]) { memcpy(duties, duty, sizeof duties); }
bool slamd_port_emergency(void) { return emergency; }

/* 1 m/s at full voltage, 60 ms until it is reached, 20 ms to brake; wheels and encoders as the settings' defaults. */
static void turn_motors(void) {
    const double mm_per_tick = 2 * 3.14159265358979 * 35 / 1440;
    for (int i = 0; i < 2; i++) {
        double lag_us = duties[i] ? 60e3 : 20e3;
        speed_mm_s[i] += (duties[i] * (1000.0 / 255) - speed_mm_s[i]) * STEP_US / lag_us;
        if (held[i]) speed_mm_s[i] = 0;
        way_mm[i] += speed_mm_s[i] * STEP_US * 1e-6;
        for (; way_mm[i] >= mm_per_tick; way_mm[i] -= mm_per_tick) counts[i]++;
        for (; way_mm[i] <= -mm_per_tick; way_mm[i] += mm_per_tick) counts[i]--;
    }
}

int main(void) {
    char word[16];
    long a, b;
    unsigned byte;
    memset(memory, 0xFF, sizeof memory);
    for (int i = 0; i < 32; i++) mode[i] = 6000;
    while (scanf("%15s %ld", word, &a) == 2) {
        if (!strcmp(word, "boot")) {
            now_us = (uint32_t)a;
            slamd_ring_begin();
        } else if (!strcmp(word, "run")) {
            for (long t = 0; t < a; t += STEP_US, now_us += STEP_US) turn_motors(), slamd_ring_poll();
        } else if (!strcmp(word, "busy")) {
            line_busy = a;
        } else if (!strcmp(word, "emergency")) {
            emergency = a;
        } else if (!strcmp(word, "hold")) { /* wheel a is held, or let go if negative */
            held[a & 1] = a >= 0;
        } else if (!strcmp(word, "store")) {
            for (long i = 0; i < a && scanf("%2x", &byte) == 1; i++) memory[i] = (uint8_t)byte;
        } else if (!strcmp(word, "hear")) {
            while (a-- && scanf("%2x", &byte) == 1) heard[heard_in++ % sizeof heard] = (uint8_t)byte;
        } else if (!strcmp(word, "sensor") && scanf("%ld", &b) == 1) {
            mode[a & 31] = b;
        } else if (!strcmp(word, "turn") && scanf("%ld", &b) == 1) { /* turns wheel a by b edges */
            static const uint8_t forward[4] = {1, 3, 0, 2}, back[4] = {2, 0, 3, 1};
            for (; b; b += b > 0 ? -1 : 1) {
                uint8_t next = b > 0 ? forward[pins[a & 1]] : back[pins[a & 1]];
                counts[a & 1] += slamd_quadrature_step(pins[a & 1], next);
                pins[a & 1] = next;
            }
        } else {
            return 1;
        }
    }
    return 0;
}
