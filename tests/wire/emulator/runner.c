/* Runs the board's firmware in an emulated ATmega2560 with 32 sonars, two encoders and two motor bridges on its pins.
 *
 * A separate program for tests, because it is linked with libsimavr. SPDX-License-Identifier: GPL-3.0-or-later
 *
 * In lock-step with the world on standard input and output, one line each way every millisecond of the emulated time and
 * whenever sonars are triggered:
 *   out: TIME_US SENT_HEX|- LEFT RIGHT [LINES]
 *   in:  LEFT_TICKS RIGHT_TICKS TO_BOARD_HEX|- {SENSOR:RISE_US:FALL_US}
 * LEFT and RIGHT are what the bridges make of their pins since the line before: the mean voltage in thousandths, or
 * "brake". If LEFT_TICKS ends with "!", the emergency switch is open. "reset" instead of an answer resets the
 * board. An empty line ends the program. Nothing depends on the wall clock, so equal answers make equal runs. */
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define CYCLES_PER_US 16
#define TICK_US 1000
#define STEP_US 125 /* at most one encoder edge and one received byte: 115200 baud, and the firmware samples every 25 us */
#define SENSORS 32
#define NEVER UINT64_MAX

static FILE *to_world;
static avr_t *avr;
static avr_irq_t *echo_pins[SENSORS], *encoder_pins[4], *uart_in;
static char sent[2048];
static uint32_t rising_lines, trigger_lines;
static uint8_t to_board[4096];
static size_t to_board_in, to_board_out;
static int board_takes_bytes = 1;
static struct {
    avr_cycle_count_t at;
    int level;
} echoes[SENSORS][2];
static avr_cycle_count_t next_echo; /* the earliest of them */
static int32_t ticks[2], wanted[2];
/* Bits of port H: enable, input 1 and input 2 of each bridge. */
static const int bridge_bits[2][3] = {{3, 5, 6}, {4, 1, 0}};
static int bridge_levels[2][3];
static avr_cycle_count_t driven_since[2], read_at;
static int64_t driven[2]; /* cycles with voltage since read_at, with its sign */
static avr_irq_t *emergency_pin;

static void on_sent(struct avr_irq_t *irq, uint32_t value, void *param) {
    size_t len = strlen(sent);
    (void)irq, (void)param;
    if (len + 3 < sizeof sent) sprintf(sent + len, "%02x", value & 0xFF);
}

static void on_flow(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq, (void)value;
    board_takes_bytes = param != NULL;
}

/* A sonar begins to sing when its trigger falls. */
static void on_trigger(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq, (void)param;
    if (value) {
        rising_lines |= value & 0xFF;
    } else {
        trigger_lines = rising_lines;
        rising_lines = 0;
    }
}

static int voltage(int wheel) {
    const int *levels = bridge_levels[wheel];
    return levels[0] ? levels[1] - levels[2] : 0;
}

static void integrate(int wheel) {
    driven[wheel] += voltage(wheel) * (int64_t)(avr->cycle - driven_since[wheel]);
    driven_since[wheel] = avr->cycle;
}

static void on_bridge(struct avr_irq_t *irq, uint32_t value, void *param) {
    int index = (int)(intptr_t)param;
    (void)irq;
    integrate(index / 3);
    bridge_levels[index / 3][index % 3] = value != 0;
}

/* The resistors at the bridge hold pins that are no outputs: enabled, and both inputs low. */
static void print_bridge(int wheel) {
    avr_ioport_state_t state;
    int64_t cycles = (int64_t)(avr->cycle - read_at);
    int shorted = bridge_levels[wheel][0] && !bridge_levels[wheel][1] && !bridge_levels[wheel][2];
    integrate(wheel);
    avr_ioctl(avr, AVR_IOCTL_IOPORT_GETSTATE('H'), &state);
    if (!(state.ddr >> bridge_bits[wheel][0] & 1) || (shorted && !driven[wheel])) fprintf(to_world, " brake");
    else fprintf(to_world, " %lld", cycles ? (long long)(1000 * driven[wheel] / cycles) : 0);
    driven[wheel] = 0;
}

/* libsimavr would sleep in real time. */
static void on_sleep(struct avr_t *sleeping, avr_cycle_count_t cycles) {
    (void)sleeping, (void)cycles;
}

static avr_irq_t *pin(char port, int bit) {
    return avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(port), bit);
}

static void wire(void) {
    static const char ports[] = "ACLK";
    uint32_t flags = 0;
    for (int i = 0; i < SENSORS; i++) echo_pins[i] = pin(ports[i / 8], i % 8);
    for (int i = 0; i < SENSORS; i++) avr_raise_irq(echo_pins[i], 0);
    for (int i = 0; i < 4; i++) encoder_pins[i] = pin('D', i);
    /* The encoders' pins are interrupt pins, too, which libsimavr would poll in each cycle though they are not enabled. */
    for (int i = 0; i < 4; i++) avr_extint_set_strict_lvl_trig(avr, (uint8_t)i, 0);
    for (int i = 0; i < 4; i++) avr_raise_irq(encoder_pins[i], 0);
    for (int i = 0; i < 6; i++) {
        avr_irq_register_notify(pin('H', bridge_bits[i / 3][i % 3]), on_bridge, (void *)(intptr_t)i);
    }
    emergency_pin = pin('B', 4);
    avr_raise_irq(emergency_pin, 0);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('F'), IOPORT_IRQ_REG_PORT), on_trigger, NULL);
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POLL_SLEEP);
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    uart_in = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), on_sent, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XON), on_flow, &avr);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XOFF), on_flow, NULL);
}

static void turn(int wheel) {
    static const uint8_t gray[] = {0, 1, 3, 2}; /* bit 0 is A: A leads */
    if (ticks[wheel] == wanted[wheel]) return;
    ticks[wheel] += ticks[wheel] < wanted[wheel] ? 1 : -1;
    avr_raise_irq(encoder_pins[2 * wheel], gray[ticks[wheel] & 3] & 1);
    avr_raise_irq(encoder_pins[2 * wheel + 1], gray[ticks[wheel] & 3] >> 1);
}

static void ring(void) {
    next_echo = NEVER;
    for (int i = 0; i < SENSORS; i++) {
        for (int edge = 0; edge < 2; edge++) {
            avr_cycle_count_t at = echoes[i][edge].at;
            if (!at) continue;
            if (at > avr->cycle) {
                if (at < next_echo) next_echo = at;
                continue;
            }
            echoes[i][edge].at = 0;
            avr_raise_irq(echo_pins[i], (uint32_t)echoes[i][edge].level);
        }
    }
}

static void step(void) {
    turn(0);
    turn(1);
    if (board_takes_bytes && to_board_out != to_board_in) {
        avr_raise_irq(uart_in, to_board[to_board_out++ % sizeof to_board]);
    }
}

/* Until a time, or until sonars are triggered. */
static int run_until(avr_cycle_count_t end) {
    static avr_cycle_count_t stepped;
    while (avr->cycle < end && !trigger_lines) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) return 0;
        if (avr->cycle >= next_echo) ring();
        if (avr->cycle >= stepped + STEP_US * CYCLES_PER_US) {
            step();
            stepped = avr->cycle;
        }
    }
    return 1;
}

static void take(char *word) {
    unsigned sensor;
    unsigned long long rise_us, fall_us;
    if (sscanf(word, "%u:%llu:%llu", &sensor, &rise_us, &fall_us) != 3 || sensor >= SENSORS) return;
    echoes[sensor][0].at = rise_us * CYCLES_PER_US;
    echoes[sensor][0].level = 1;
    echoes[sensor][1].at = fall_us * CYCLES_PER_US;
    echoes[sensor][1].level = 0;
    next_echo = 0;
}

static int answer(void) {
    static char line[16384];
    char *word;
    if (!fgets(line, sizeof line, stdin) || line[0] == '\n') return 0;
    if (!(word = strtok(line, " \n"))) return 0;
    if (!strcmp(word, "reset")) {
        avr_reset(avr);
        wire();
        return 1;
    }
    avr_raise_irq(emergency_pin, strchr(word, '!') != NULL);
    wanted[0] = atoi(word);
    if (!(word = strtok(NULL, " \n"))) return 0;
    wanted[1] = atoi(word);
    if (!(word = strtok(NULL, " \n"))) return 0;
    for (unsigned byte; word[0] != '-' && sscanf(word, "%2x", &byte) == 1; word += 2) {
        to_board[to_board_in++ % sizeof to_board] = (uint8_t)byte;
    }
    while ((word = strtok(NULL, " \n"))) take(word);
    return 1;
}

int main(int argc, char **argv) {
    elf_firmware_t firmware = {0};
    /* libsimavr logs to standard output. */
    to_world = fdopen(dup(1), "w");
    if (!to_world || dup2(2, 1) < 0) return 71;
    if (argc != 2 || elf_read_firmware(argv[1], &firmware)) {
        fprintf(stderr, "usage: runner FIRMWARE.elf\n");
        return 64;
    }
    avr = avr_make_mcu_by_name("atmega2560");
    avr_init(avr);
    avr->log = LOG_ERROR;
    avr->sleep = on_sleep;
    firmware.frequency = CYCLES_PER_US * 1000000;
    avr_load_firmware(avr, &firmware);
    avr->frequency = CYCLES_PER_US * 1000000;
    wire();
    for (uint64_t tick = TICK_US;;) {
        uint64_t us = tick;
        if (!run_until((avr_cycle_count_t)tick * CYCLES_PER_US)) return 70;
        if (trigger_lines) us = avr->cycle / CYCLES_PER_US;
        fprintf(to_world, "%llu %s", (unsigned long long)us, sent[0] ? sent : "-");
        for (int wheel = 0; wheel < 2; wheel++) print_bridge(wheel);
        read_at = avr->cycle;
        if (trigger_lines) fprintf(to_world, " %u", trigger_lines);
        else tick += TICK_US;
        fprintf(to_world, "\n");
        trigger_lines = 0;
        fflush(to_world);
        sent[0] = 0;
        if (!answer()) return 0;
    }
}
