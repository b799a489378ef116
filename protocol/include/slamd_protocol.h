/* slamd's wire format for boards, in C99. SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * A frame is COBS(type u8 | seq u8 | payload | CRC-32 LE) 0x00, all numbers little-endian. The
 * specification is protocol/README.md; tests/c_header.rs checks this header against its golden
 * vectors. */
#ifndef SLAMD_PROTOCOL_H
#define SLAMD_PROTOCOL_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#ifdef __AVR__
#include <avr/pgmspace.h>
#define SLAMD_FLASH PROGMEM
#define SLAMD_FLASH_U32(at) pgm_read_dword(at)
#else
#define SLAMD_FLASH
#define SLAMD_FLASH_U32(at) (*(at))
#endif

#define SLAMD_VERSION_MAJOR 1
#define SLAMD_VERSION_MINOR 1
#define SLAMD_MAX_PAYLOAD 244
#define SLAMD_MAX_CONTENT (SLAMD_MAX_PAYLOAD + 6)
#define SLAMD_MAX_FRAME (SLAMD_MAX_CONTENT + 2)
#define SLAMD_MAX_SENSORS 64
#define SLAMD_MAX_PLACEMENTS 26
#define SLAMD_MAX_ECHOES SLAMD_MAX_SENSORS

enum slamd_kind {
    SLAMD_HELLO = 0x01, SLAMD_GEOMETRY = 0x02, SLAMD_SONAR = 0x10, SLAMD_ENCODER = 0x11, SLAMD_STATUS = 0x12,
    SLAMD_FAULT = 0x13, SLAMD_MOTION = 0x14, SLAMD_TIME_RESPONSE = 0x20, SLAMD_ACK = 0x30, SLAMD_CONFIG_VALUE = 0x31, SLAMD_LOG = 0x3F,
    SLAMD_HELLO_REQUEST = 0x81, SLAMD_START = 0x82, SLAMD_STOP = 0x83, SLAMD_CONFIG_SET = 0x84,
    SLAMD_CONFIG_GET = 0x85, SLAMD_GEOMETRY_REQUEST = 0x86, SLAMD_DRIVE = 0x87, SLAMD_TIME_REQUEST = 0x90,
    SLAMD_HEARTBEAT = 0x91
};

/* Codes that replace a time of flight. */
#define SLAMD_ECHO_NONE 0xFFFFu
#define SLAMD_ECHO_STUCK 0xFFFEu
#define SLAMD_ECHO_HIGH_AT_TRIGGER 0xFFFDu
#define SLAMD_ECHO_DISABLED 0xFFFCu
#define SLAMD_ECHO_BLANKED 0xFFFBu
#define SLAMD_MAX_FLIGHT_US 0xFFFAu

#define SLAMD_LAST_OF_CYCLE 1
#define SLAMD_UNKNOWN_TEMPERATURE 0x7FFF

/* DRIVE and MOTION: HELLO's capability bit, and the limits of a command. */
#define SLAMD_CAPABILITY_DRIVES 1
#define SLAMD_MAX_SPEED_MM_S 2000
#define SLAMD_MIN_VALID_MS 50
#define SLAMD_MAX_VALID_MS 1000

enum slamd_fault { SLAMD_FAULT_CLEARED, SLAMD_FAULT_PIN_STUCK, SLAMD_FAULT_HIGH_AT_TRIGGER, SLAMD_FAULT_NEVER_ANSWERS };
enum slamd_motion {
    SLAMD_IDLE, SLAMD_DRIVING, SLAMD_TIME_OUT, SLAMD_OBSTACLE, SLAMD_STALL, SLAMD_EMERGENCY_PIN, SLAMD_NO_MOTORS
};
enum slamd_result { SLAMD_DONE, SLAMD_UNKNOWN, SLAMD_REFUSED, SLAMD_BUSY };

/* X(name, key, minimum, maximum, default) */
#define SLAMD_SETTINGS(X)                        \
    X(SENSORS, 1, 1, SLAMD_MAX_SENSORS, 32)      \
    X(GROUPS, 2, 1, 8, 4)                        \
    X(SLOT_US, 3, 10000, 60000, 25000)           \
    X(ENCODER_PERIOD_MS, 4, 5, 1000, 20)         \
    X(TICKS_PER_TURN, 5, 1, 10000000, 1440)      \
    X(LEFT_REVERSED, 6, 0, 1, 0)                 \
    X(RIGHT_REVERSED, 7, 0, 1, 0)                \
    X(WHEELS_SWAPPED, 8, 0, 1, 0)                \
    X(RING_RADIUS_MM, 9, 0, 2000, 150)           \
    X(HALF_ANGLE_CDEG, 10, 0, 6000, 1250)        \
    X(CLOCKWISE, 11, 0, 1, 0)                    \
    X(MAX_RANGE_MM, 12, 100, 6000, 3000)         \
    X(TOP_SPEED_MM_S, 13, 0, SLAMD_MAX_SPEED_MM_S, 0) \
    X(ACCELERATION_MM_S2, 14, 50, 5000, 500)     \
    X(STOP_DISTANCE_MM, 15, 0, 2000, 250)        \
    X(WHEEL_RADIUS_UM, 16, 5000, 500000, 35000)  \
    X(GAIN_FORWARD, 17, 0, 1000, 100)            \
    X(GAIN_PROPORTIONAL, 18, 0, 1000, 100)       \
    X(GAIN_INTEGRAL, 19, 0, 2000, 300)           \
    X(LEFT_MOTOR_REVERSED, 20, 0, 1, 0)          \
    X(RIGHT_MOTOR_REVERSED, 21, 0, 1, 0)

#define SLAMD_SETTING_KEY_(name, key, least, most, value) SLAMD_##name = key,
enum slamd_setting { SLAMD_SETTINGS(SLAMD_SETTING_KEY_) SLAMD_SETTING_END_ };
#undef SLAMD_SETTING_KEY_
#define SLAMD_SETTING_COUNT 21

/* CRC-32/ISO-HDLC, a nibble at a time, so the table has only 64 bytes. Start with 0; continue with
 * the last result. */
static inline uint32_t slamd_crc32(uint32_t crc, const uint8_t *bytes, uint16_t len) {
    static const uint32_t table[16] SLAMD_FLASH = {
        0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4, 0x4DB26158, 0x5005713C,
        0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C, 0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C};
    crc = ~crc;
    while (len--) {
        crc ^= *bytes++;
        crc = (crc >> 4) ^ SLAMD_FLASH_U32(&table[crc & 15]);
        crc = (crc >> 4) ^ SLAMD_FLASH_U32(&table[crc & 15]);
    }
    return ~crc;
}

/* A payload under construction, with room for type and number before and the checksum after it. */
struct slamd_writer {
    uint8_t content[SLAMD_MAX_CONTENT];
    uint8_t len;
};

static inline void slamd_u8(struct slamd_writer *w, uint8_t v) {
    if (w->len < SLAMD_MAX_CONTENT - 4) w->content[w->len++] = v;
}
static inline void slamd_u16(struct slamd_writer *w, uint16_t v) {
    slamd_u8(w, (uint8_t)v);
    slamd_u8(w, (uint8_t)(v >> 8));
}
static inline void slamd_u32(struct slamd_writer *w, uint32_t v) {
    slamd_u16(w, (uint16_t)v);
    slamd_u16(w, (uint16_t)(v >> 16));
}
static inline void slamd_begin(struct slamd_writer *w, uint8_t kind, uint8_t seq) {
    w->content[0] = kind;
    w->content[1] = seq;
    w->len = 2;
}

/* Writes the finished frame, at most SLAMD_MAX_FRAME bytes, into `frame` and returns its length. */
static inline uint16_t slamd_finish(struct slamd_writer *w, uint8_t *frame) {
    uint32_t crc = slamd_crc32(0, w->content, w->len);
    uint16_t out = 1, code_at = 0;
    for (uint8_t i = 0; i < 4; i++, crc >>= 8) w->content[w->len++] = (uint8_t)crc;
    frame[0] = 1;
    for (uint8_t i = 0; i < w->len; i++) {
        if (w->content[i] == 0) {
            code_at = out;
            frame[out++] = 1;
        } else {
            frame[out++] = w->content[i];
            frame[code_at]++;
        }
    }
    frame[out++] = 0;
    return out;
}

struct slamd_hello {
    uint32_t boot_id, tick_hz, ticks_per_turn, capabilities, config_crc;
    uint8_t sensors;
    uint8_t uid[8];
    const char *board, *firmware; /* at most 16 bytes each */
};

static inline void slamd_text16(struct slamd_writer *w, const char *text) {
    for (uint8_t i = 0; i < 16; i++) slamd_u8(w, *text ? (uint8_t)*text++ : 0);
}

static inline void slamd_put_hello(struct slamd_writer *w, uint8_t seq, const struct slamd_hello *h) {
    slamd_begin(w, SLAMD_HELLO, seq);
    slamd_u8(w, SLAMD_VERSION_MAJOR);
    slamd_u8(w, SLAMD_VERSION_MINOR);
    slamd_u32(w, h->boot_id);
    slamd_u32(w, h->tick_hz);
    slamd_u8(w, h->sensors);
    slamd_u32(w, h->ticks_per_turn);
    slamd_u32(w, h->capabilities);
    slamd_u32(w, h->config_crc);
    for (uint8_t i = 0; i < 8; i++) slamd_u8(w, h->uid[i]);
    slamd_text16(w, h->board);
    slamd_text16(w, h->firmware);
}

/* GEOMETRY: begin, then up to SLAMD_MAX_PLACEMENTS placements. */
static inline void slamd_begin_geometry(struct slamd_writer *w, uint8_t seq, uint8_t total, uint8_t first) {
    slamd_begin(w, SLAMD_GEOMETRY, seq);
    slamd_u8(w, total);
    slamd_u8(w, first);
}
static inline void slamd_put_placement(struct slamd_writer *w, int16_t x_mm, int16_t y_mm, int16_t bearing_cdeg,
                                       uint16_t half_angle_cdeg, uint8_t group) {
    slamd_u16(w, (uint16_t)x_mm);
    slamd_u16(w, (uint16_t)y_mm);
    slamd_u16(w, (uint16_t)bearing_cdeg);
    slamd_u16(w, half_angle_cdeg);
    slamd_u8(w, group);
}

/* SONAR: begin, then up to SLAMD_MAX_ECHOES echoes. */
static inline void slamd_begin_sonar(struct slamd_writer *w, uint8_t seq, uint32_t t_us, uint8_t group, bool last,
                                     int32_t left_ticks, int32_t right_ticks) {
    slamd_begin(w, SLAMD_SONAR, seq);
    slamd_u32(w, t_us);
    slamd_u8(w, group);
    slamd_u8(w, last ? SLAMD_LAST_OF_CYCLE : 0);
    slamd_u32(w, (uint32_t)left_ticks);
    slamd_u32(w, (uint32_t)right_ticks);
}
static inline void slamd_put_echo(struct slamd_writer *w, uint8_t sensor, uint16_t echo) {
    slamd_u8(w, sensor);
    slamd_u16(w, echo);
}

static inline void slamd_put_encoder(struct slamd_writer *w, uint8_t seq, uint32_t t_us, int32_t left_ticks,
                                     int32_t right_ticks) {
    slamd_begin(w, SLAMD_ENCODER, seq);
    slamd_u32(w, t_us);
    slamd_u32(w, (uint32_t)left_ticks);
    slamd_u32(w, (uint32_t)right_ticks);
    slamd_u8(w, 0);
}

struct slamd_status {
    uint32_t t_us, frames, overruns, crc_errors;
    int16_t temperature_cdeg; /* SLAMD_UNKNOWN_TEMPERATURE if not measured */
    uint16_t supply_mv;       /* 0 if not measured */
    uint64_t stuck_mask;
};
static inline void slamd_put_status(struct slamd_writer *w, uint8_t seq, const struct slamd_status *s) {
    slamd_begin(w, SLAMD_STATUS, seq);
    slamd_u32(w, s->t_us);
    slamd_u32(w, s->frames);
    slamd_u32(w, s->overruns);
    slamd_u32(w, s->crc_errors);
    slamd_u16(w, (uint16_t)s->temperature_cdeg);
    slamd_u16(w, s->supply_mv);
    slamd_u32(w, (uint32_t)s->stuck_mask);
    slamd_u32(w, (uint32_t)(s->stuck_mask >> 32));
}

static inline void slamd_put_fault(struct slamd_writer *w, uint8_t seq, uint32_t t_us, uint8_t sensor, uint8_t code) {
    slamd_begin(w, SLAMD_FAULT, seq);
    slamd_u32(w, t_us);
    slamd_u8(w, sensor);
    slamd_u8(w, code);
}
/* Speeds in mm/s, left wheel first. */
static inline void slamd_put_motion(struct slamd_writer *w, uint8_t seq, uint32_t t_us, uint8_t state,
                                    const int16_t commanded[2], const int16_t measured[2]) {
    slamd_begin(w, SLAMD_MOTION, seq);
    slamd_u32(w, t_us);
    slamd_u8(w, state);
    slamd_u16(w, (uint16_t)commanded[0]);
    slamd_u16(w, (uint16_t)commanded[1]);
    slamd_u16(w, (uint16_t)measured[0]);
    slamd_u16(w, (uint16_t)measured[1]);
}
static inline void slamd_put_time_response(struct slamd_writer *w, uint8_t seq, uint16_t token, uint32_t rx_us,
                                           uint32_t tx_us) {
    slamd_begin(w, SLAMD_TIME_RESPONSE, seq);
    slamd_u16(w, token);
    slamd_u32(w, rx_us);
    slamd_u32(w, tx_us);
}
static inline void slamd_put_ack(struct slamd_writer *w, uint8_t seq, uint8_t of_type, uint8_t of_seq, uint8_t result) {
    slamd_begin(w, SLAMD_ACK, seq);
    slamd_u8(w, of_type);
    slamd_u8(w, of_seq);
    slamd_u8(w, result);
}
static inline void slamd_put_config_value(struct slamd_writer *w, uint8_t seq, uint8_t key, int32_t value) {
    slamd_begin(w, SLAMD_CONFIG_VALUE, seq);
    slamd_u8(w, key);
    slamd_u32(w, (uint32_t)value);
}
static inline void slamd_put_log(struct slamd_writer *w, uint8_t seq, uint8_t level, const char *text) {
    slamd_begin(w, SLAMD_LOG, seq);
    slamd_u8(w, level);
    while (*text) slamd_u8(w, (uint8_t)*text++);
}

/* Finds frames in a stream of bytes. Initialize it with zeros. */
struct slamd_decoder {
    uint8_t content[SLAMD_MAX_CONTENT];
    uint8_t len, block_left;
    bool inside, overlong;
    uint32_t crc_errors, malformed;
};

/* Takes a byte; returns true if the byte completes a good frame: content[0] is its type, content[1]
 * its number, and the payload's len - 6 bytes follow. They are valid until the next byte. */
static inline bool slamd_push(struct slamd_decoder *d, uint8_t byte) {
    if (byte == 0) {
        bool was_inside = d->inside;
        uint32_t crc = 0;
        d->inside = false;
        if (!was_inside || d->overlong) return false;
        if (d->block_left || d->len < 6) {
            d->malformed++;
            return false;
        }
        for (uint8_t i = 1; i <= 4; i++) crc = crc << 8 | d->content[d->len - i];
        if (crc == slamd_crc32(0, d->content, (uint16_t)(d->len - 4))) return true;
        d->crc_errors++;
        return false;
    }
    if (!d->inside) {
        d->inside = true;
        d->overlong = false;
        d->len = 0;
        d->block_left = (uint8_t)(byte - 1);
        return false;
    }
    if (d->overlong) return false;
    if (d->len == SLAMD_MAX_CONTENT) {
        d->overlong = true;
        d->malformed++;
        return false;
    }
    if (d->block_left) {
        d->block_left--;
        d->content[d->len++] = byte;
    } else {
        d->block_left = (uint8_t)(byte - 1);
        d->content[d->len++] = 0;
    }
    return false;
}

/* A request of the host; `kind` determines which fields are valid. */
struct slamd_request {
    uint8_t kind, seq;
    uint8_t major, minor; /* HELLO_REQUEST */
    uint8_t key;          /* CONFIG_SET, CONFIG_GET */
    int32_t value;        /* CONFIG_SET */
    uint16_t token;       /* TIME_REQUEST */
    int16_t mm_s[2];      /* DRIVE: left, right */
    uint16_t valid_ms;    /* DRIVE */
    uint8_t source;       /* DRIVE: for the record alone */
};

/* Parses the frame that slamd_push completed; returns false if it is not a valid message of a host.
 * Longer payloads come from a newer minor version and are accepted. */
static inline bool slamd_parse(const struct slamd_decoder *d, struct slamd_request *r) {
    const uint8_t *p = d->content + 2;
    uint8_t len = (uint8_t)(d->len - 6);
    memset(r, 0, sizeof *r);
    r->kind = d->content[0];
    r->seq = d->content[1];
    switch (r->kind) {
    case SLAMD_START: case SLAMD_STOP: case SLAMD_GEOMETRY_REQUEST: case SLAMD_HEARTBEAT:
        return true;
    case SLAMD_HELLO_REQUEST:
        if (len < 2) return false;
        r->major = p[0];
        r->minor = p[1];
        return true;
    case SLAMD_CONFIG_SET:
        if (len < 5) return false;
        r->key = p[0];
        r->value = (int32_t)((uint32_t)p[1] | (uint32_t)p[2] << 8 | (uint32_t)p[3] << 16 | (uint32_t)p[4] << 24);
        return true;
    case SLAMD_CONFIG_GET:
        if (len < 1) return false;
        r->key = p[0];
        return true;
    case SLAMD_TIME_REQUEST:
        if (len < 2) return false;
        r->token = (uint16_t)(p[0] | (uint16_t)p[1] << 8);
        return true;
    case SLAMD_DRIVE:
        if (len < 7) return false;
        for (uint8_t i = 0; i < 2; i++) {
            r->mm_s[i] = (int16_t)(p[2 * i] | (uint16_t)p[2 * i + 1] << 8);
            if (r->mm_s[i] < -SLAMD_MAX_SPEED_MM_S || r->mm_s[i] > SLAMD_MAX_SPEED_MM_S) return false;
        }
        r->valid_ms = (uint16_t)(p[4] | (uint16_t)p[5] << 8);
        r->source = p[6];
        return r->valid_ms >= SLAMD_MIN_VALID_MS && r->valid_ms <= SLAMD_MAX_VALID_MS;
    default:
        return false;
    }
}

#endif
