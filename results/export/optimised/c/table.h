/* The gait arcfold as pulse widths. Made by gaitopt export; gaitopt reads this file back as the gait.
 * Include it in one source file.
 *
 * gaitopt-table: {"format": 1, "hash": "5aad26ec537904d3", "name": "arcfold", "period_us": 586570, "frame_us": 20000, "led_pin": 2, "gait": {"period_s": 0.5865698491473572, "channels": {"mid_act": {"duty": 0.6343174429030245, "phase": 0.0, "amplitude_deg": 90.0, "offset_deg": 0.0, "smoothing": 0.061427004150841416}, "foot1": {"duty": 0.3871285802215715, "phase": 0.6895344844286302, "amplitude_deg": -89.8474528281229, "offset_deg": -0.14043874243372756, "smoothing": 0.0}, "foot2": {"duty": 0.4910160159653011, "phase": 0.12064154550916495, "amplitude_deg": -88.98526271533252, "offset_deg": -1.0013966917305372, "smoothing": 0.0003680815016024047}}}, "servos": {"mid_act": {"pin": 12, "neutral_us": 1000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot1": {"pin": 13, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot2": {"pin": 14, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}}, "start_us": [1000, 2000, 2000], "slew_us": [0, 0, 0]}
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
    1500, 1998, 1001,
    1995, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1998, 1001,
    1999, 1370, 1001,
    1999, 1001, 1001,
    1999, 1001, 1001,
    1999, 1001, 1001,
    1999, 1001, 1787,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1999, 1001, 1989,
    1912, 1001, 1989,
    1184, 1001, 1989,
    1000, 1001, 1989,
    1000, 1001, 1989,
    1000, 1001, 1989,
    1000, 1853, 1989,
    1000, 1998, 1989,
    1000, 1998, 1989,
    1000, 1998, 1989,
    1000, 1998, 1989,
    1000, 1998, 1989,
    1000, 1998, 1989,
    1000, 1998, 1989,
    1000, 1998, 1989,
    1000, 1998, 1989,
    1000, 1998, 1989,
    1000, 1998, 1771,
    1000, 1998, 1001,
    1000, 1998, 1001,
    1000, 1998, 1001,
    1000, 1998, 1001,
    1000, 1998, 1001,
    1000, 1998, 1001,
    1004, 1998, 1001,
};

static const gait_table_t gait_table = {
    0x5aad26ec, /* hash */
    586570u, /* period, us */
    20000u, /* frame, us */
    64, /* samples */
    3, /* servos */
    2, /* LED pin */
    gait_servos,
    gait_pulses_us,
};

#endif
