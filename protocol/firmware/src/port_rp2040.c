/* Raspberry Pi Pico (RP2040), without an SDK. SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * A GPIO interrupt stamps every edge of the echo and encoder pins with the microsecond timer. */
#ifdef SLAMD_RP2040

#include "rp2040.h"
#include "slamd_motors.h"
#include "slamd_port.h"
#include "slamd_protocol.h"
#include "slamd_ring.h"

#define CLOCK_HZ 125000000UL
#define BAUD 115200UL
#define BYTE_US 87
#define TICK_US 200
#define CONTROL_US 120000UL /* without a call of the control, the motors brake and the chip resets */

enum { FUNCTION_UART = 2, FUNCTION_PWM = 4, FUNCTION_SIO = 5 };
enum { PAD_FLOATING = 0x52, PAD_PULL_DOWN = 0x56, PAD_PULL_UP = 0x5A };
#define EDGES(pin) (12UL << 4 * ((pin) % 8)) /* rising and falling */

/* GP2 to GP5: encoders, left A and B, right A and B. GP6 to GP9: trigger lines. Echo pins of sensors 0 to 12: GP10 to GP22,
 * 13 to 15: GP26 to GP28. With 8 sensors or fewer the pins from GP18 on drive the motors. */
#define TX 0
#define RX 1
#define UART (1UL << 22)
#define ENCODERS 2
#define TRIGGERS 6
#define ECHOES 10
#define LED 25
#define SENSORS_WITH_MOTORS 8
#define ENABLES 18  /* left, right */
#define EMERGENCY 27
static const uint8_t inputs[2][2] = {{20, 21}, {22, 26}};
#define INPUTS (1UL << 20 | 1UL << 21 | 1UL << 22 | 1UL << 26)
static const uint8_t shared[] = {18, 19, 20, 21, 22, 26, 27, 28};

const char slamd_port_board[] = "rp2040";

static uint32_t last_levels;
static uint8_t last_encoders;

static bool motor_pins;
static volatile bool driven;          /* the control has spoken */
static volatile uint32_t control_us;  /* when it spoke last */

static uint32_t lock(void) {
    uint32_t before;
    __asm volatile("mrs %0, primask\n cpsid i" : "=r"(before)::"memory");
    return before;
}

static void unlock(uint32_t before) {
    __asm volatile("msr primask, %0" ::"r"(before) : "memory");
}

static void feed_uart(void);

#define SLAMD_ATOMIC for (uint32_t once = 1, before = lock(); once; once = 0, unlock(before))
#define SLAMD_ATOMIC_WORD /* one access is whole */
#define START_SENDING() feed_uart()
#include "slamd_queues.h"

static uint32_t levels_of(uint32_t pins) {
    return (pins >> ECHOES & 0x1FFF) | (pins >> 26 & 7) << 13;
}

static void brake(void) {
    PINS_CLEAR = INPUTS;
    PINS_SET = 3UL << ENABLES;
    FUNCTION(ENABLES) = FUNCTION(ENABLES + 1) = FUNCTION_SIO;
}

/* Of the same priority as slamd_rp2040_tick, so neither interrupts the other. */
void slamd_rp2040_sample(void) {
    /* Cleared first: an edge after that calls again. */
    for (uint8_t pin = 0; pin < 32; pin += 8) EDGES_SEEN(pin) = 0xCCCCCCCC;
    uint32_t t_us = TIMER_NOW, pins = PINS_IN, levels = levels_of(pins);
    uint8_t encoders = pins >> ENCODERS & 15, next = (edge_in + 1) & 63;
    /* If the queue is full, the next tick sees the change. */
    if (levels != last_levels && next != edge_out) {
        last_levels = levels;
        edges[edge_in].t_us = t_us;
        edges[edge_in].levels = levels;
        edge_in = next;
    }
    if (encoders != last_encoders) {
        counts[0] += slamd_quadrature_step(last_encoders, encoders);
        counts[1] += slamd_quadrature_step(last_encoders >> 2, encoders >> 2);
        last_encoders = encoders;
    }
}

void slamd_rp2040_tick(void) {
    slamd_rp2040_sample();
    if (driven && TIMER_NOW - control_us >= CONTROL_US) brake();
}

/* Call with interrupts disabled, or from the interrupt. */
static void feed_uart(void) {
    while (sending_out != sending_in && !(UART_FLAGS & 0x20)) {
        UART_DATA = sending[sending_out];
        sending_out = (sending_out + 1) & 1023;
    }
    UART_WANTED = sending_out != sending_in ? 0x30 : 0x10;
}

void slamd_rp2040_uart(void) {
    while (!(UART_FLAGS & 0x10)) {
        uint8_t byte = (uint8_t)UART_DATA, next = (received_in + 1) & 127;
        if (next == received_out) continue;
        received[received_in] = byte;
        received_in = next;
        if (byte == 0) delimiter_us[delimiter_in++ & 15] = TIMER_NOW;
    }
    feed_uart();
}

/* 12 MHz crystal, times 125, by 12. */
static void begin_clocks(void) {
    XOSC_STARTUP = 470; /* 10 ms */
    XOSC_CTRL = 0xFABAA0;
    while (!(XOSC_STATUS >> 31)) {
    }
    CLK_REF_CTRL = 2;
    while (!(CLK_REF_SELECTED & 4)) {
    }
    PLL_CS = 1;
    PLL_FBDIV = 125;
    REG(PLL_PWR + CLEAR) = 0x21;
    while (!(PLL_CS >> 31)) {
    }
    PLL_PRIM = 6UL << 16 | 2UL << 12;
    REG(PLL_PWR + CLEAR) = 0x08;
    CLK_SYS_CTRL = 0;
    CLK_SYS_CTRL = 1;
    while (!(CLK_SYS_SELECTED & 2)) {
    }
    CLK_PERI_CTRL = 1UL << 11;
    WATCHDOG_TICK = 1UL << 9 | 12; /* of the timer, too: a microsecond */
}

static void begin_input(uint8_t pin, uint32_t pad) {
    OUTPUTS_CLEAR = 1UL << pin;
    PAD(pin) = pad;
    FUNCTION(pin) = FUNCTION_SIO;
}

static void begin_output(uint8_t pin) {
    PINS_CLEAR = 1UL << pin;
    OUTPUTS_SET = 1UL << pin;
    PAD(pin) = PAD_PULL_DOWN;
    FUNCTION(pin) = FUNCTION_SIO;
}

static void listen(uint8_t pin) {
    EDGES_SEEN(pin) = EDGES(pin);
    REG(EDGES_WANTED(pin) + SET) = EDGES(pin);
}

/* Echo pins 8 to 15, or the motors' pins. */
static void share_pins(bool motors) {
    uint32_t before = lock();
    motor_pins = motors;
    driven = false;
    for (uint8_t i = 0; i < sizeof shared; i++) {
        if (motors) REG(EDGES_WANTED(shared[i]) + CLEAR) = EDGES(shared[i]);
        begin_input(shared[i], motors ? PAD_FLOATING : PAD_PULL_DOWN);
        if (!motors) listen(shared[i]);
    }
    if (motors) {
        PAD(EMERGENCY) = PAD_PULL_UP;
        PINS_CLEAR = INPUTS;
        PINS_SET = 3UL << ENABLES;
        OUTPUTS_SET = INPUTS | 3UL << ENABLES;
        PWM_DIV = 250UL << 4;
        PWM_TOP = 509; /* 980 Hz */
        PWM_CC = 0;
        PWM_CSR = 1;
    }
    unlock(before);
    if (!motors) return;
    for (uint32_t since_us = TIMER_NOW; TIMER_NOW - since_us < 200;) { /* until the pull-up has charged the cable */
    }
}

bool slamd_port_has_motors(void) {
    return slamd_setting(SLAMD_SENSORS) <= SENSORS_WITH_MOTORS;
}

static bool has_motor_pins(void) {
    if (slamd_port_has_motors() != motor_pins) share_pins(!motor_pins);
    return motor_pins;
}

bool slamd_port_emergency(void) {
    return has_motor_pins() && PINS_IN >> EMERGENCY & 1;
}

void slamd_port_motors(const int16_t duty[2]) {
    if (!has_motor_pins()) return;
    uint32_t before = lock(), highs = 0, compare = 0;
    for (uint8_t i = 0; i < 2; i++) {
        if (duty[i]) highs |= 1UL << inputs[i][duty[i] < 0];
        compare |= (uint32_t)(duty[i] > 0 ? duty[i] : -duty[i]) * 2 << 16 * i;
    }
    control_us = TIMER_NOW;
    driven = true;
    /* A motor that is not driven brakes: enabled, and both inputs low. */
    PINS_CLEAR = INPUTS & ~highs;
    PWM_CC = compare;
    for (uint8_t i = 0; i < 2; i++) FUNCTION(ENABLES + i) = duty[i] ? FUNCTION_PWM : FUNCTION_SIO;
    PINS_SET = highs | 3UL << ENABLES;
    unlock(before);
}

uint32_t slamd_port_now_us(void) {
    return TIMER_NOW;
}

uint32_t slamd_port_levels(void) {
    return levels_of(PINS_IN);
}

void slamd_port_trigger(uint8_t lines) {
    uint32_t pins = (uint32_t)lines << TRIGGERS, since_us = TIMER_NOW;
    PINS_SET = pins;
    PINS_TOGGLE = 1UL << LED;
    while (TIMER_NOW - since_us < 11) {
    }
    PINS_CLEAR = pins;
}

static void begin_uart(void) {
    UART_IBRD = CLOCK_HZ / (16 * BAUD);
    UART_FBRD = ((CLOCK_HZ % (16 * BAUD)) * 64 + 8 * BAUD) / (16 * BAUD);
    UART_LCR = 0x60; /* 8N1 without FIFOs: each byte interrupts as it arrives */
    UART_CTRL = 0x301;
    UART_WANTED = 0x10;
    PAD(TX) = PAD_PULL_UP;
    PAD(RX) = PAD_PULL_UP;
    FUNCTION(TX) = FUNCTION(RX) = FUNCTION_UART;
}

void slamd_port_begin(void) {
    uint32_t used = 1UL << 5 | 1UL << 8 | 1UL << 12 | 1UL << 14 | 1UL << 21; /* pins, pads, PLL, PWM, timer */
    REG(RESETS + CLEAR) = used;
    while (~REG(RESETS + 8) & used) {
    }
    begin_clocks();
    REG(RESETS + CLEAR) = UART; /* which gets ready only with its clock */
    while (~REG(RESETS + 8) & UART) {
    }
    slamd_rp2040_begin_flash();
    for (uint8_t i = 0; i < 4; i++) begin_output(TRIGGERS + i);
    begin_output(LED);
    for (uint8_t i = 0; i < 4; i++) begin_input(ENCODERS + i, PAD_PULL_UP); /* many encoders have open-collector outputs */
    for (uint8_t i = 0; i < SENSORS_WITH_MOTORS; i++) begin_input(ECHOES + i, PAD_PULL_DOWN);
    for (uint8_t i = 0; i < 4; i++) listen(ENCODERS + i);
    for (uint8_t i = 0; i < SENSORS_WITH_MOTORS; i++) listen(ECHOES + i);
    share_pins(false);
    begin_uart();
    last_levels = levels_of(PINS_IN);
    last_encoders = PINS_IN >> ENCODERS & 15;
    /* The interrupt of the UART is the least urgent. */
    NVIC_PRIORITY(20) = 0x40;
    NVIC_ENABLE = 1UL << 13 | 1UL << 20;
    SYST_RVR = CLOCK_HZ / 1000000 * TICK_US - 1;
    SYST_CVR = 0;
    SYST_CSR = 7;
    PSM_WDSEL = 0x1FFFC; /* a reset by the watchdog resets all but the oscillators */
    WATCHDOG_LOAD = 2 * CONTROL_US; /* it counts twice per microsecond */
    WATCHDOG_CTRL = 1UL << 30 | 7UL << 24;
    __asm volatile("cpsie i" ::: "memory");
}

/* Each sleep ends with the next tick. */
void slamd_port_rest(void) {
    WATCHDOG_LOAD = 2 * CONTROL_US;
    slamd_rp2040_keep_settings();
    if (waiting()) { /* in case that an interrupt of the UART was missed */
        uint32_t before = lock();
        feed_uart();
        unlock(before);
    }
    __asm volatile("wfi" ::: "memory");
}

#endif
