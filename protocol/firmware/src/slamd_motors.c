/* Speed control and every reason to stand still, without hardware access. SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * A reason to stop is looked for in each step; only if there is none, the wheels follow the last DRIVE. */
#include "slamd_motors.h"
#include "slamd_port.h"
#include "slamd_protocol.h"
#include <math.h>
#include <stdlib.h>

#define SENSORS_MAX 32
#define STEP_US 10000UL   /* of the control */
#define WINDOW 5          /* steps over which a speed is measured: 50 ms */
#define STALL_US 500000UL
#define STALL_TICKS 3     /* a slow wheel with few ticks per turn is no stalled one */
#define REACH_S 0.2f      /* way until the robot stands: a cycle of the ring, and the brakes */
#define SIDE_MM 50        /* an echo farther to the side than the ring's radius and this is passed by */
#define LOOKS_CDEG 4500   /* sensors this near to the motion's direction must tell something */
#define FULL 255

static int16_t wanted[2];                /* the last DRIVE, within the top speed */
static uint32_t drive_us, valid_us, heard_us, step_us;
static uint8_t state;
static bool known, latched;              /* latched: stall or emergency, until a DRIVE of 0, 0 */
static float commanded[2], integral[2], measured[2];
static int32_t past[WINDOW][2];
static uint8_t at;
static int32_t last[2];
static uint32_t turned_us[2];            /* when the wheel last turned as commanded */
static struct slamd_view views[SENSORS_MAX];

static float mm_per_tick(void) {
    return 6.2831853f * 1e-3f * (float)slamd_setting(SLAMD_WHEEL_RADIUS_UM) / (float)slamd_setting(SLAMD_TICKS_PER_TURN);
}

static void brake(void) {
    static const int16_t none[2] = {0, 0};
    for (uint8_t i = 0; i < 2; i++) commanded[i] = integral[i] = 0;
    if (known) slamd_port_motors(none);
}

void slamd_motors_stop(void) {
    wanted[0] = wanted[1] = 0;
    valid_us = 0;
    latched = false;
    state = SLAMD_IDLE;
    for (uint8_t i = 0; i < SENSORS_MAX; i++) views[i].tells = false;
    brake();
}

void slamd_motors_heard(uint32_t now_us) {
    heard_us = now_us;
}

void slamd_motors_drive(const int16_t mm_s[2], uint16_t valid_ms, uint32_t now_us) {
    int32_t top = slamd_setting(SLAMD_TOP_SPEED_MM_S);
    int32_t fastest = abs(mm_s[0]) > abs(mm_s[1]) ? abs(mm_s[0]) : abs(mm_s[1]);
    for (uint8_t i = 0; i < 2; i++) wanted[i] = fastest > top ? (int16_t)(mm_s[i] * top / fastest) : mm_s[i];
    drive_us = now_us;
    valid_us = valid_ms * 1000UL;
    known = true;
    if (!fastest) latched = false;
}

void slamd_motors_see(uint8_t sensor, struct slamd_view view) {
    views[sensor] = view;
}

/* Forward, backward or, on the spot, 0. */
static int8_t direction(void) {
    int32_t ahead = (int32_t)wanted[0] + wanted[1], turn = (int32_t)wanted[1] - wanted[0];
    if (labs(ahead) * 8 <= labs(turn)) return 0;
    return ahead > 0 ? 1 : -1;
}

/* Something stands where the robot would drive, or nobody can tell. */
static bool is_blocked(void) {
    int8_t way = direction();
    uint8_t total = (uint8_t)slamd_setting(SLAMD_SENSORS), looking = 0, telling = 0;
    float radius = (float)slamd_setting(SLAMD_RING_RADIUS_MM);
    float reach = (float)slamd_setting(SLAMD_STOP_DISTANCE_MM) + REACH_S * 0.5f * fabsf((float)wanted[0] + wanted[1]);
    if (!way) return false;
    for (uint8_t i = 0; i < total; i++) {
        int32_t cdeg = 36000L * i / total;
        float rad, far;
        if (way < 0) cdeg += cdeg < 18000 ? 18000 : -18000;
        if (cdeg > 18000) cdeg -= 36000;
        if (labs(cdeg) <= LOOKS_CDEG) looking++;
        if (!views[i].tells) continue;
        if (labs(cdeg) <= LOOKS_CDEG) telling++;
        if (labs(cdeg) >= 9000 || (float)views[i].range_mm > reach + radius) continue;
        rad = (float)cdeg * 1.7453293e-4f;
        far = radius + (float)views[i].range_mm;
        if (far * cosf(rad) - radius < reach && fabsf(far * sinf(rad)) <= radius + SIDE_MM) return true;
    }
    return 2 * telling < looking || !looking;
}

/* A wheel that is driven, and does not turn or turns the wrong way. */
static bool is_stalled(uint32_t now_us) {
    for (uint8_t i = 0; i < 2; i++) {
        uint32_t since_us = now_us - turned_us[i];
        float ticks = fabsf(commanded[i]) * (float)since_us * 1e-6f / mm_per_tick();
        if (since_us >= STALL_US && ticks >= STALL_TICKS) return true;
    }
    return false;
}

static uint8_t judge(uint32_t now_us) {
    if (!slamd_setting(SLAMD_TOP_SPEED_MM_S)) return known ? SLAMD_NO_MOTORS : SLAMD_IDLE;
    if (latched && state == SLAMD_STALL) return SLAMD_STALL;
    if (known && slamd_port_emergency()) {
        latched = true;
        return SLAMD_EMERGENCY_PIN;
    }
    if (latched) return state;
    if (!wanted[0] && !wanted[1]) return SLAMD_IDLE;
    if (now_us - drive_us >= valid_us || now_us - heard_us >= SLAMD_SILENCE_US) return SLAMD_TIME_OUT;
    if (is_blocked()) return SLAMD_OBSTACLE;
    if (is_stalled(now_us)) {
        latched = true;
        return SLAMD_STALL;
    }
    return SLAMD_DRIVING;
}

static void measure(uint32_t now_us, const int32_t ticks[2]) {
    float scale = mm_per_tick() / (WINDOW * STEP_US * 1e-6f);
    for (uint8_t i = 0; i < 2; i++) {
        int32_t step = (int32_t)((uint32_t)ticks[i] - (uint32_t)last[i]);
        if (commanded[i] == 0 || (step > 0 && commanded[i] > 0) || (step < 0 && commanded[i] < 0)) turned_us[i] = now_us;
        last[i] = ticks[i];
        measured[i] = scale * (float)(int32_t)((uint32_t)ticks[i] - (uint32_t)past[at][i]);
        past[at][i] = ticks[i];
    }
    at = (uint8_t)(at + 1) % WINDOW;
}

static float clamped(float value, float most) {
    return value > most ? most : value < -most ? -most : value;
}

static void follow(void) {
    float ramp = (float)slamd_setting(SLAMD_ACCELERATION_MM_S2) * (STEP_US * 1e-6f);
    float unit = FULL / 1e5f; /* of the gains: thousandths of full per 100 mm/s */
    int16_t duty[2];
    for (uint8_t i = 0; i < 2; i++) {
        float error, before = integral[i], sum;
        commanded[i] += clamped((float)wanted[i] - commanded[i], ramp);
        if (commanded[i] == 0) {
            integral[i] = 0;
            duty[i] = 0;
            continue;
        }
        error = commanded[i] - measured[i];
        integral[i] += unit * (float)slamd_setting(SLAMD_GAIN_INTEGRAL) * error * (STEP_US * 1e-6f);
        sum = unit * ((float)slamd_setting(SLAMD_GAIN_FORWARD) * commanded[i] +
                      (float)slamd_setting(SLAMD_GAIN_PROPORTIONAL) * error) + integral[i];
        if (fabsf(sum) > FULL) integral[i] = before;
        duty[i] = (int16_t)clamped(sum, FULL);
        if (slamd_setting(SLAMD_LEFT_MOTOR_REVERSED + i)) duty[i] = (int16_t)-duty[i];
    }
    slamd_port_motors(duty);
}

bool slamd_motors_poll(uint32_t now_us, const int32_t ticks[2]) {
    uint8_t before = state;
    if (now_us - step_us < STEP_US) return false;
    /* From step to step; after a long pause from now on. */
    step_us = now_us - step_us < 2 * STEP_US ? step_us + STEP_US : now_us;
    measure(now_us, ticks);
    state = judge(now_us);
    /* What has run out stays so, also when the clock has wrapped. */
    if (state == SLAMD_TIME_OUT) valid_us = 0;
    if (state == SLAMD_DRIVING) follow();
    else brake();
    return state != before && known;
}

bool slamd_motors_are_known(void) {
    return known;
}

uint8_t slamd_motors_state(void) {
    return state;
}

static int16_t rounded(float mm_s) {
    return (int16_t)lroundf(clamped(mm_s, 32767));
}

void slamd_motors_speeds(int16_t commanded_mm_s[2], int16_t measured_mm_s[2]) {
    for (uint8_t i = 0; i < 2; i++) {
        commanded_mm_s[i] = rounded(commanded[i]);
        measured_mm_s[i] = rounded(measured[i]);
    }
}
