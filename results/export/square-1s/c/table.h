/* The gait square-1s as pulse widths. Made by gaitopt export; gaitopt reads this file back as the gait.
 * Include it in one source file.
 *
 * gaitopt-table: {"format": 1, "hash": "302bd8d26203bd70", "name": "square-1s", "period_us": 1000000, "frame_us": 20000, "led_pin": 2, "gait": {"period_s": 1.0, "channels": {"mid_act": {"duty": 0.5, "phase": 0.25, "amplitude_deg": 90.0, "offset_deg": 0.0, "smoothing": 0.0}, "foot1": {"duty": 0.5, "phase": 0.0, "amplitude_deg": -90.0, "offset_deg": 0.0, "smoothing": 0.0}, "foot2": {"duty": 0.5, "phase": 0.5, "amplitude_deg": -90.0, "offset_deg": 0.0, "smoothing": 0.0}}}, "servos": {"mid_act": {"pin": 12, "neutral_us": 1000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot1": {"pin": 13, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot2": {"pin": 14, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}}, "start_us": [1000, 2000, 2000], "slew_us": [0, 0, 0]}
 */
#ifndef GAIT_TABLE_H
#define GAIT_TABLE_H

#include "gait_player.h"

static const gait_servo_t gait_servos[] = {
    /* pin, start, min, max, slew per frame; us */
    {12, 1000, 500, 2500, 0}, /* mid_act */
    {13, 2000, 500, 2500, 0}, /* foot1 */
    {14, 2000, 500, 2500, 0}, /* foot2 */
};

/* One row per uniform phase, one column per servo; us. */
static const uint16_t gait_pulses_us[] = {
    1999, 1500, 1500,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1999, 1001, 2000,
    1500, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1001, 2000,
    1000, 1500, 1500,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1000, 2000, 1001,
    1500, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
    1999, 2000, 1001,
};

static const gait_table_t gait_table = {
    0x302bd8d2, /* hash */
    1000000u, /* period, us */
    20000u, /* frame, us */
    64, /* samples */
    3, /* servos */
    2, /* LED pin */
    gait_servos,
    gait_pulses_us,
};

#endif
