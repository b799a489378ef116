/* Reads one frame per line in hexadecimal and prints how the C header parses it. */
#include "slamd_protocol.h"
#include <stdio.h>

static const uint8_t *at;
static uint8_t u8(void) { return *at++; }
static uint16_t u16(void) { uint16_t low = u8(); return (uint16_t)(low | u8() << 8); }
static uint32_t u32(void) { uint32_t low = u16(); return low | (uint32_t)u16() << 16; }

/* Encodes the board's message again with the header's encoder. */
static bool again(const struct slamd_decoder *d, struct slamd_writer *w) {
    uint8_t kind = d->content[0], seq = d->content[1];
    const uint8_t *end = d->content + d->len - 4;
    at = d->content + 2;
    switch (kind) {
    case SLAMD_HELLO: {
        struct slamd_hello h;
        char board[17] = {0}, firmware[17] = {0};
        uint8_t major = u8(), minor = u8();
        h.boot_id = u32(), h.tick_hz = u32(), h.sensors = u8(), h.ticks_per_turn = u32();
        h.capabilities = u32(), h.config_crc = u32();
        memcpy(h.uid, at, 8);
        memcpy(board, at + 8, 16);
        memcpy(firmware, at + 24, 16);
        h.board = board, h.firmware = firmware;
        slamd_put_hello(w, seq, &h);
        w->content[2] = major, w->content[3] = minor; /* vectors of older versions, too */
        return true;
    }
    case SLAMD_GEOMETRY: {
        uint8_t total = u8(), first = u8();
        slamd_begin_geometry(w, seq, total, first);
        while (at < end) {
            uint16_t x = u16(), y = u16(), bearing = u16(), half = u16();
            slamd_put_placement(w, (int16_t)x, (int16_t)y, (int16_t)bearing, half, u8());
        }
        return true;
    }
    case SLAMD_SONAR: {
        uint32_t t = u32();
        uint8_t group = u8(), flags = u8();
        uint32_t left = u32(), right = u32();
        slamd_begin_sonar(w, seq, t, group, flags & SLAMD_LAST_OF_CYCLE, (int32_t)left, (int32_t)right);
        while (at < end) {
            uint8_t sensor = u8();
            slamd_put_echo(w, sensor, u16());
        }
        return true;
    }
    case SLAMD_ENCODER: {
        uint32_t t = u32(), left = u32(), right = u32();
        slamd_put_encoder(w, seq, t, (int32_t)left, (int32_t)right);
        return true;
    }
    case SLAMD_STATUS: {
        struct slamd_status s;
        s.t_us = u32(), s.frames = u32(), s.overruns = u32(), s.crc_errors = u32();
        s.temperature_cdeg = (int16_t)u16(), s.supply_mv = u16();
        s.stuck_mask = u32();
        s.stuck_mask |= (uint64_t)u32() << 32;
        slamd_put_status(w, seq, &s);
        return true;
    }
    case SLAMD_FAULT: {
        uint32_t t = u32();
        uint8_t sensor = u8();
        slamd_put_fault(w, seq, t, sensor, u8());
        return true;
    }
    case SLAMD_MOTION: {
        uint32_t t = u32();
        uint8_t state = u8();
        int16_t speeds[4];
        for (int i = 0; i < 4; i++) speeds[i] = (int16_t)u16();
        slamd_put_motion(w, seq, t, state, speeds, speeds + 2);
        return true;
    }
    case SLAMD_TIME_RESPONSE: {
        uint16_t token = u16();
        uint32_t rx = u32();
        slamd_put_time_response(w, seq, token, rx, u32());
        return true;
    }
    case SLAMD_ACK: {
        uint8_t of_type = u8(), of_seq = u8();
        slamd_put_ack(w, seq, of_type, of_seq, u8());
        return true;
    }
    case SLAMD_CONFIG_VALUE: {
        uint8_t key = u8();
        slamd_put_config_value(w, seq, key, (int32_t)u32());
        return true;
    }
    case SLAMD_LOG: {
        char text[SLAMD_MAX_PAYLOAD] = {0};
        uint8_t level = u8();
        memcpy(text, at, (size_t)(end - at));
        slamd_put_log(w, seq, level, text);
        return true;
    }
    default: return false;
    }
}

/* Encodes the host's message again from its parsed fields. */
static bool asked(const struct slamd_decoder *d, struct slamd_writer *w) {
    struct slamd_request r;
    if (!slamd_parse(d, &r)) return false;
    slamd_begin(w, r.kind, r.seq);
    if (r.kind == SLAMD_HELLO_REQUEST) slamd_u8(w, r.major), slamd_u8(w, r.minor);
    if (r.kind == SLAMD_CONFIG_SET || r.kind == SLAMD_CONFIG_GET) slamd_u8(w, r.key);
    if (r.kind == SLAMD_CONFIG_SET) slamd_u32(w, (uint32_t)r.value);
    if (r.kind == SLAMD_DRIVE) {
        slamd_u16(w, (uint16_t)r.mm_s[0]);
        slamd_u16(w, (uint16_t)r.mm_s[1]);
        slamd_u16(w, r.valid_ms);
        slamd_u8(w, r.source);
    }
    if (r.kind == SLAMD_TIME_REQUEST) slamd_u16(w, r.token);
    return true;
}

int main(void) {
    static char line[4096];
#define SAY(name, key, least, most, value) printf("setting %d %ld %ld %ld\n", key, (long)least, (long)most, (long)value);
    SLAMD_SETTINGS(SAY)
    while (fgets(line, sizeof line, stdin)) {
        struct slamd_decoder d = {0};
        struct slamd_writer w;
        uint8_t frame[SLAMD_MAX_FRAME];
        unsigned byte;
        bool whole = false;
        for (char *hex = line; sscanf(hex, "%2x", &byte) == 1; hex += 2) whole = slamd_push(&d, (uint8_t)byte);
        if (whole && (again(&d, &w) || asked(&d, &w))) {
            uint16_t len = slamd_finish(&w, frame);
            for (uint16_t i = 0; i < len; i++) printf("%02x", frame[i]);
            puts("");
        } else {
            puts(whole ? "message" : d.crc_errors ? "crc" : d.malformed ? "malformed" : "nothing");
        }
    }
    return 0;
}
