/* The board's behaviour, without hardware access. SPDX-License-Identifier: MIT OR Apache-2.0 */
#include "slamd_ring.h"
#include "slamd_motors.h"
#include "slamd_port.h"
#include "slamd_protocol.h"
#include <math.h>

#define SENSORS_MAX 32 /* of any port */
#define HELLO_US 100000UL /* between two HELLO messages until the host answers */
#define MOTION_US 100000UL /* between two MOTION messages */
#define MUTE_CYCLES 8 /* unanswered pings in a row before a sensor is reported */

/* Non-volatile: the boot counter, the settings, their checksum. */
#define BOOT_AT 0
#define SETTINGS_AT 4
#define SETTINGS_LEN (4 * SLAMD_SETTING_COUNT)
#define SETTINGS_LEN_1_0 (4 * 12)
#define STORE_LEN (SETTINGS_AT + SETTINGS_LEN + 4)

static const struct {
    int32_t least, most, value;
} limits[SLAMD_SETTING_COUNT] = {
#define DEFAULT(key, value) ((key) == SLAMD_SENSORS && (value) > SLAMD_PORT_SENSORS ? SLAMD_PORT_SENSORS : (value))
#define LIMITS(name, key, least, most, value) {least, most, DEFAULT(key, value)},
    SLAMD_SETTINGS(LIMITS)};

static struct slamd_writer out;
static struct slamd_decoder decoder;
static uint8_t frame[SLAMD_MAX_FRAME];
static uint8_t store[STORE_LEN];
static uint8_t store_at;
static int32_t settings[SLAMD_SETTING_COUNT];
static uint32_t frames, overruns, boot_id;
static uint8_t seq;
static bool streaming, greeted;
static uint32_t status_us, encoder_us, hello_us, motion_us;

static bool pinging;
static uint8_t group;
static uint32_t due_us, trigger_us, levels, high_at_trigger, rose, fell, stuck;
static int32_t trigger_ticks[2];
static uint32_t rise_us[SENSORS_MAX];
static uint16_t flight_us[SENSORS_MAX];
static uint8_t faults[SENSORS_MAX], mute[SENSORS_MAX];

static int32_t setting(uint8_t key) {
    return settings[key - 1];
}

int32_t slamd_setting(uint8_t key) {
    return setting(key);
}

static void put32(uint8_t *at, uint32_t v) {
    for (uint8_t i = 0; i < 4; i++, v >>= 8) at[i] = (uint8_t)v;
}

static uint32_t get32(const uint8_t *at) {
    return at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static void send(void) {
    uint16_t len = slamd_finish(&out, frame);
    if (slamd_port_send(frame, len)) {
        frames++;
        seq++;
    } else {
        overruns++;
    }
}

static bool groups_fit(int32_t groups) {
    return groups == 1 || groups == 2 || groups == 4 || groups == SLAMD_PORT_TRIGGER_LINES;
}

static bool accepts(uint8_t key, int32_t value) {
    if (key == SLAMD_SENSORS && value > SLAMD_PORT_SENSORS) return false;
    return value >= limits[key - 1].least && value <= limits[key - 1].most && (key != SLAMD_GROUPS || groups_fit(value));
}

static uint32_t settings_crc(void) {
    return slamd_crc32(0, store + SETTINGS_AT, SETTINGS_LEN);
}

static void settings_to_store(void) {
    for (uint8_t i = 0; i < SLAMD_SETTING_COUNT; i++) put32(store + SETTINGS_AT + 4 * i, (uint32_t)settings[i]);
    put32(store + SETTINGS_AT + SETTINGS_LEN, settings_crc());
    store_at = 0;
}

static void load(void) {
    uint8_t known = 0; /* settings with a good checksum: all, those of a firmware for 1.0, or none */
    for (uint8_t i = 0; i < STORE_LEN; i++) store[i] = slamd_port_load(i);
    if (get32(store + SETTINGS_AT + SETTINGS_LEN) == settings_crc()) {
        known = SLAMD_SETTING_COUNT;
    } else if (get32(store + SETTINGS_AT + SETTINGS_LEN_1_0) == slamd_crc32(0, store + SETTINGS_AT, SETTINGS_LEN_1_0)) {
        known = SETTINGS_LEN_1_0 / 4;
    }
    for (uint8_t i = 0; i < SLAMD_SETTING_COUNT; i++) {
        settings[i] = (int32_t)get32(store + SETTINGS_AT + 4 * i);
        if (i >= known || !accepts(i + 1, settings[i])) settings[i] = limits[i].value;
    }
    boot_id = get32(store + BOOT_AT) + 1;
    put32(store + BOOT_AT, boot_id);
    settings_to_store();
}

/* Starts to write at most one byte per call, because a write takes milliseconds. */
static void save(void) {
    if (store_at < STORE_LEN && slamd_port_store(store_at, store[store_at])) store_at++;
}

static void send_hello(void) {
    struct slamd_hello hello = {boot_id, 1000000, (uint32_t)setting(SLAMD_TICKS_PER_TURN),
                                slamd_port_has_motors() ? SLAMD_CAPABILITY_DRIVES : 0, settings_crc(), (uint8_t)setting(SLAMD_SENSORS), {'s', 'l', 'a', 'm', 'd', 'r', 'n', 'g'},
                                slamd_port_board, SLAMD_FIRMWARE_VERSION};
    slamd_port_uid(hello.uid);
    slamd_put_hello(&out, seq, &hello);
    send();
    hello_us = slamd_port_now_us();
}

static void send_geometry(void) {
    uint8_t total = (uint8_t)setting(SLAMD_SENSORS);
    int32_t radius_mm = setting(SLAMD_RING_RADIUS_MM);
    for (uint8_t first = 0; first < total; first += SLAMD_MAX_PLACEMENTS) {
        slamd_begin_geometry(&out, seq, total, first);
        for (uint8_t i = first; i < total && i < first + SLAMD_MAX_PLACEMENTS; i++) {
            int32_t cdeg = (36000L * i + total / 2) / total;
            double rad;
            if (cdeg > 18000) cdeg -= 36000;
            if (setting(SLAMD_CLOCKWISE)) cdeg = -cdeg;
            rad = (double)cdeg * (3.14159265358979 / 18000);
            slamd_put_placement(&out, (int16_t)lround((double)radius_mm * cos(rad)),
                                (int16_t)lround((double)radius_mm * sin(rad)), (int16_t)cdeg,
                                (uint16_t)setting(SLAMD_HALF_ANGLE_CDEG), i % (uint8_t)setting(SLAMD_GROUPS));
        }
        send();
    }
}

static void read_wheels(int32_t wheels[2]) {
    int32_t ticks[2];
    uint8_t swapped = (uint8_t)setting(SLAMD_WHEELS_SWAPPED);
    slamd_port_ticks(ticks);
    for (uint8_t i = 0; i < 2; i++) {
        uint32_t count = (uint32_t)ticks[i ^ swapped];
        wheels[i] = (int32_t)(setting(SLAMD_LEFT_REVERSED + i) ? 0 - count : count);
    }
}

static uint8_t set(uint8_t key, int32_t value) {
    if (key < 1 || key > SLAMD_SETTING_COUNT) return SLAMD_UNKNOWN;
    if (value == setting(key)) return SLAMD_DONE;
    if (!accepts(key, value)) return SLAMD_REFUSED;
    if (streaming && (key <= SLAMD_SLOT_US || key >= SLAMD_MAX_RANGE_MM)) return SLAMD_BUSY;
    settings[key - 1] = value;
    settings_to_store();
    return SLAMD_DONE;
}

static void answer(const struct slamd_request *r, uint32_t rx_us) {
    uint8_t result;
    greeted = true;
    switch (r->kind) {
    case SLAMD_HELLO_REQUEST: send_hello(); return;
    case SLAMD_GEOMETRY_REQUEST: send_geometry(); return;
    case SLAMD_TIME_REQUEST:
        slamd_put_time_response(&out, seq, r->token, rx_us, slamd_port_now_us() + slamd_port_send_delay_us());
        send();
        return;
    case SLAMD_CONFIG_GET:
        if (r->key >= 1 && r->key <= SLAMD_SETTING_COUNT) {
            slamd_put_config_value(&out, seq, r->key, setting(r->key));
            send();
            return;
        }
        result = SLAMD_UNKNOWN;
        break;
    case SLAMD_CONFIG_SET: result = set(r->key, r->value); break;
    case SLAMD_START:
        if (!streaming) {
            slamd_motors_stop();
            uint32_t now_us = slamd_port_now_us();
            pinging = false;
            group = 0;
            due_us = now_us;
            status_us = now_us - 1000000;
            encoder_us = now_us - (uint32_t)setting(SLAMD_ENCODER_PERIOD_MS) * 1000;
        }
        streaming = true;
        result = SLAMD_DONE;
        break;
    case SLAMD_STOP:
        streaming = pinging = false;
        slamd_motors_stop();
        result = SLAMD_DONE;
        break;
    case SLAMD_DRIVE:
        if (slamd_port_has_motors() && streaming) {
            slamd_motors_drive(r->mm_s, r->valid_ms, rx_us);
            return;
        }
        result = slamd_port_has_motors() ? SLAMD_BUSY : SLAMD_UNKNOWN;
        break;
    default: return;
    }
    slamd_put_ack(&out, seq, r->kind, r->seq, result);
    send();
}

static void hear(void) {
    uint8_t byte;
    uint32_t t_us;
    struct slamd_request request;
    /* Bounded, so that a host that sends without pause cannot stop the firing. */
    for (uint8_t i = 0; i < 64 && slamd_port_receive(&byte, &t_us); i++) {
        if (!slamd_push(&decoder, byte)) continue;
        if (slamd_parse(&decoder, &request)) {
            slamd_motors_heard(t_us);
            answer(&request, t_us);
        } else if (request.kind == SLAMD_DRIVE) { /* a speed or a time that no DRIVE may have */
            slamd_put_ack(&out, seq, request.kind, request.seq, SLAMD_REFUSED);
            send();
        }
    }
}

static void take_edges(void) {
    struct slamd_edge edge;
    while (slamd_port_next_edge(&edge)) {
        uint32_t changed = edge.levels ^ levels;
        levels = edge.levels;
        if (!pinging || (int32_t)(edge.t_us - trigger_us) < 0) continue;
        for (uint8_t i = 0; changed; i++, changed >>= 1) {
            uint32_t bit = (uint32_t)1 << i;
            if (!(changed & 1)) continue;
            if (edge.levels & bit) {
                if (!(rose & bit)) rise_us[i] = edge.t_us;
                rose |= bit;
            } else if (!(fell & bit)) {
                uint32_t us = edge.t_us - rise_us[i];
                fell |= bit;
                flight_us[i] = us > SLAMD_MAX_FLIGHT_US ? SLAMD_ECHO_NONE : (uint16_t)us;
            }
        }
    }
}

static void report_fault(uint8_t sensor, uint8_t code) {
    uint32_t bit = (uint32_t)1 << sensor;
    stuck = code == SLAMD_FAULT_PIN_STUCK ? stuck | bit : stuck & ~bit;
    if (faults[sensor] == code) return;
    faults[sensor] = code;
    slamd_put_fault(&out, seq, slamd_port_now_us(), sensor, code);
    send();
}

/* The echo of sensor i; false if it did not answer. */
static bool echo_of(uint8_t i, uint16_t *echo, uint8_t *fault) {
    uint32_t bit = (uint32_t)1 << i;
    uint32_t max_us = (uint32_t)setting(SLAMD_MAX_RANGE_MM) * 2000 / 343; /* sound at 20 degrees Celsius */
    *fault = SLAMD_FAULT_CLEARED;
    *echo = SLAMD_ECHO_NONE;
    if (high_at_trigger & bit) {
        *echo = fell & bit ? SLAMD_ECHO_HIGH_AT_TRIGGER : SLAMD_ECHO_STUCK;
        *fault = fell & bit ? SLAMD_FAULT_HIGH_AT_TRIGGER : SLAMD_FAULT_PIN_STUCK;
    } else if (!(rose & bit)) {
        *fault = SLAMD_FAULT_NEVER_ANSWERS;
        return false;
    } else if (fell & bit && flight_us[i] <= max_us) {
        *echo = flight_us[i];
    }
    return true;
}

static void end_ping(void) {
    uint8_t total = (uint8_t)setting(SLAMD_SENSORS), groups = (uint8_t)setting(SLAMD_GROUPS);
    uint16_t echo;
    uint8_t fault;
    slamd_begin_sonar(&out, seq, trigger_us, group, group + 1 == groups, trigger_ticks[0], trigger_ticks[1]);
    for (uint8_t i = group; i < total; i += groups) {
        if (echo_of(i, &echo, &fault)) slamd_put_echo(&out, i, echo);
    }
    send();
    for (uint8_t i = group; i < total; i += groups) {
        bool answered = echo_of(i, &echo, &fault);
        struct slamd_view view = {answered && fault == SLAMD_FAULT_CLEARED, UINT16_MAX};
        if (echo <= SLAMD_MAX_FLIGHT_US) view.range_mm = (uint16_t)(echo * 343UL / 2000);
        slamd_motors_see(i, view);
        if (answered) mute[i] = 0;
        else if (mute[i] < MUTE_CYCLES) mute[i]++;
        if (answered || mute[i] == MUTE_CYCLES) report_fault(i, fault);
    }
    group = group + 1 < groups ? group + 1 : 0;
}

static void begin_ping(void) {
    uint8_t lines = 0, groups = (uint8_t)setting(SLAMD_GROUPS);
    for (uint8_t line = group; line < SLAMD_PORT_TRIGGER_LINES; line += groups) lines |= (uint8_t)(1 << line);
    rose = fell = 0;
    levels = high_at_trigger = slamd_port_levels();
    read_wheels(trigger_ticks);
    trigger_us = slamd_port_now_us();
    pinging = true;
    slamd_port_trigger(lines);
}

static void fire(void) {
    take_edges();
    if (!streaming || (int32_t)(slamd_port_now_us() - due_us) < 0) return;
    /* Counts from slot to slot, so that the time to send the echoes does not lower the rate. */
    due_us += (uint32_t)setting(SLAMD_SLOT_US);
    if (pinging) end_ping();
    begin_ping();
}

static void send_motion(uint32_t now_us) {
    int16_t commanded[2], measured[2];
    slamd_motors_speeds(commanded, measured);
    slamd_put_motion(&out, seq, now_us, slamd_motors_state(), commanded, measured);
    send();
    motion_us = now_us;
}

static void drive(void) {
    int32_t wheels[2];
    uint32_t now_us = slamd_port_now_us();
    read_wheels(wheels);
    bool changed = slamd_motors_poll(now_us, wheels);
    bool due = streaming && slamd_motors_are_known() && now_us - motion_us >= MOTION_US;
    if (changed || due) send_motion(now_us);
}

static void report(void) {
    uint32_t now_us = slamd_port_now_us(), period_us = (uint32_t)setting(SLAMD_ENCODER_PERIOD_MS) * 1000;
    if (!greeted && now_us - hello_us >= HELLO_US) send_hello();
    if (!streaming) return;
    if (now_us - encoder_us >= period_us) {
        int32_t wheels[2];
        encoder_us = now_us;
        read_wheels(wheels);
        slamd_put_encoder(&out, seq, now_us, wheels[0], wheels[1]);
        send();
    }
    if (now_us - status_us >= 1000000) {
        struct slamd_status status = {now_us, frames, overruns, decoder.crc_errors, SLAMD_UNKNOWN_TEMPERATURE, 0, stuck};
        status_us = now_us;
        slamd_put_status(&out, seq, &status);
        send();
    }
}

void slamd_ring_begin(void) {
    slamd_port_begin();
    load();
    slamd_motors_stop();
    send_hello();
}

void slamd_ring_poll(void) {
    fire();
    hear();
    drive();
    report();
    save();
    slamd_port_rest();
}
