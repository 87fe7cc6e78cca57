/* The gait best as pulse widths. Made by gaitopt export; gaitopt reads this file back as the gait.
 * Include it in one source file.
 *
 * gaitopt-table: {"format": 1, "hash": "290df68ed3ce7c93", "name": "best", "period_us": 252641, "frame_us": 20000, "led_pin": 2, "gait": {"period_s": 0.25264133482816764, "channels": {"mid_act": {"duty": 0.5374869488318403, "phase": 0.0, "amplitude_deg": 58.52989382432963, "offset_deg": 31.45117425844441, "smoothing": 0.12006873710156098}, "foot1": {"duty": 0.2710496240332806, "phase": 0.5766491071046529, "amplitude_deg": -9.908627364948728, "offset_deg": -0.0491919326628647, "smoothing": 0.8541265952831952}, "foot2": {"duty": 0.3938370417804481, "phase": 0.02940176155203169, "amplitude_deg": -10.145434345906779, "offset_deg": -0.3966072687658908, "smoothing": 0.1667112538094498}}}, "servos": {"mid_act": {"pin": 12, "neutral_us": 1000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot1": {"pin": 13, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot2": {"pin": 14, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}}, "start_us": [1000, 2000, 2000], "slew_us": [0, 0, 0]}
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
    1674, 1999, 1885,
    1917, 1999, 1883,
    1998, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1999, 1883,
    1999, 1997, 1883,
    1999, 1993, 1893,
    1999, 1986, 1926,
    1999, 1978, 1966,
    1999, 1968, 1992,
    1999, 1957, 1996,
    1999, 1946, 1996,
    1999, 1934, 1996,
    1999, 1923, 1996,
    1999, 1913, 1996,
    1999, 1904, 1996,
    1999, 1897, 1996,
    1971, 1892, 1996,
    1783, 1890, 1996,
    1515, 1889, 1996,
    1362, 1889, 1996,
    1349, 1890, 1996,
    1349, 1891, 1996,
    1349, 1894, 1996,
    1349, 1900, 1996,
    1349, 1908, 1996,
    1349, 1917, 1996,
    1349, 1928, 1996,
    1349, 1939, 1996,
    1349, 1951, 1996,
    1349, 1962, 1996,
    1349, 1973, 1996,
    1349, 1982, 1996,
    1349, 1990, 1996,
    1349, 1995, 1996,
    1349, 1998, 1996,
    1349, 1999, 1996,
    1349, 1999, 1996,
    1349, 1999, 1996,
    1349, 1999, 1996,
    1349, 1999, 1996,
    1349, 1999, 1996,
    1349, 1999, 1996,
    1349, 1999, 1996,
    1349, 1999, 1995,
    1349, 1999, 1980,
    1350, 1999, 1944,
    1431, 1999, 1906,
};

static const gait_table_t gait_table = {
    0x290df68e, /* hash */
    252641u, /* period, us */
    20000u, /* frame, us */
    64, /* samples */
    3, /* servos */
    2, /* LED pin */
    gait_servos,
    gait_pulses_us,
};

#endif
