/* Plays a gait table: pulse widths of RC servos, one set per frame, from a clock in microseconds.
 *
 * No input or output, no allocation, no floating point. Call gait_tick() as often as you like, at
 * least once a frame, with a 32-bit microsecond clock that may wrap; when it returns true, send
 * player.pulse_us[i] to servo i (0: send no pulses).
 *
 * Frames lie on a grid that begins at gait_start(), so jitter of the calls does not add up, and a
 * late call skips frames instead of slowing the gait down.
 */
#ifndef GAIT_PLAYER_H
#define GAIT_PLAYER_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifndef GAIT_MAX_SERVOS
#define GAIT_MAX_SERVOS 16
#endif

#define GAIT_RAMP_US (UINT32_C(1) << 20)    /* amplitude from none to full: 1.05 s */
#define GAIT_STAGGER_US (UINT32_C(1) << 18) /* one servo after another is energised: 0.26 s */
#define GAIT_DUTY_BITS 14                   /* timer resolution that every ESP32 has at 50 Hz */

typedef struct {
    int16_t pin;       /* GPIO; -1: none */
    uint16_t start_us; /* pulse held before and after the gait */
    uint16_t min_us;   /* never a shorter pulse */
    uint16_t max_us;   /* never a longer pulse */
    uint16_t slew_us;  /* largest change per frame; 0: not limited */
} gait_servo_t;

typedef struct {
    uint32_t hash;            /* of the table's content, as its file says it */
    uint32_t period_us;       /* one cycle of the gait */
    uint32_t frame_us;        /* period of the servo signal */
    uint16_t samples;         /* rows of pulse_us: uniform phases, the first at phase 0 */
    uint16_t servos;          /* columns of pulse_us, at most GAIT_MAX_SERVOS */
    int16_t led_pin;          /* GPIO of the sync mark; -1: none */
    const gait_servo_t *servo;
    const uint16_t *pulse_us;
} gait_table_t;

typedef enum { GAIT_OFF, GAIT_ENERGISING, GAIT_WALKING, GAIT_STOPPING, GAIT_HOLDING } gait_state_t;

typedef struct {
    const gait_table_t *table; /* NULL: refused */
    gait_state_t state;
    uint64_t phase;        /* position in the cycle, 2^64 to a cycle: wraps with it */
    uint64_t phase_per_us;
    uint32_t ramp_us;      /* amplitude, GAIT_RAMP_US is all of it */
    uint32_t energised_us; /* time since the first servo was energised, until all are */
    uint32_t frame_at_us;  /* clock at the last frame */
    uint16_t pulse_us[GAIT_MAX_SERVOS];
} gait_player_t;

/* Servos off, the table's own period. False for a table that cannot be played, and then the servos stay
 * off whatever is called: a period, frame, samples or servos of 0, more than GAIT_MAX_SERVOS, or a servo
 * whose shortest pulse is 0 or above its longest. */
bool gait_init(gait_player_t *player, const gait_table_t *table);

/* Energise the servos one after another, then walk: gait time 0 is the first frame in GAIT_WALKING. */
void gait_start(gait_player_t *player, uint32_t now_us);

/* Ramp out to the start pose and hold it. */
void gait_stop(gait_player_t *player);

/* No more pulses, at once. */
void gait_release(gait_player_t *player);

/* Walk faster or slower from here on, without a jump; a period of 0 is ignored. */
void gait_set_period(gait_player_t *player, uint32_t period_us);

/* Return true once a frame, with new pulses. */
bool gait_tick(gait_player_t *player, uint32_t now_us);

/* Level of the sync LED: high from gait time 0 until the gait stops. */
bool gait_led(const gait_player_t *player);

/* Duty of a pulse for a timer of GAIT_DUTY_BITS. */
uint32_t gait_duty(const gait_table_t *table, uint16_t pulse_us);

#ifdef __cplusplus
}
#endif

#endif
