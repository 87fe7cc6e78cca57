/* The gait best as pulse widths. Made by gaitopt export; gaitopt reads this file back as the gait.
 * Include it in one source file.
 *
 * gaitopt-table: {"format": 1, "hash": "1006ab767cd719af", "name": "best", "period_us": 250000, "frame_us": 20000, "led_pin": 2, "gait": {"period_s": 0.25, "channels": {"mid_act": {"duty": 0.5600538171349486, "phase": 0.0, "amplitude_deg": 48.812114799328405, "offset_deg": 41.187885200671595, "smoothing": 0.35635000218282237}, "foot1": {"duty": 0.31022823000856814, "phase": 0.5222533799034832, "amplitude_deg": -20.276650772120774, "offset_deg": -0.41748146196090374, "smoothing": 0.8159253908875185}, "foot2": {"duty": 0.3506784603939005, "phase": 0.060240437540127006, "amplitude_deg": -14.40752043956968, "offset_deg": -0.08165703019048465, "smoothing": 0.2237101894792677}}}, "servos": {"mid_act": {"pin": 12, "neutral_us": 1000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot1": {"pin": 13, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot2": {"pin": 14, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}}, "start_us": [1000, 2000, 2000], "slew_us": [0, 0, 0]}
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
    1728, 1995, 1839,
    1811, 1995, 1839,
    1886, 1995, 1839,
    1946, 1995, 1839,
    1984, 1995, 1839,
    1998, 1995, 1839,
    1999, 1995, 1839,
    1999, 1995, 1839,
    1999, 1995, 1839,
    1999, 1995, 1839,
    1999, 1995, 1839,
    1999, 1995, 1839,
    1999, 1995, 1839,
    1999, 1995, 1839,
    1999, 1995, 1839,
    1999, 1995, 1839,
    1999, 1995, 1840,
    1999, 1995, 1853,
    1999, 1995, 1891,
    1999, 1995, 1939,
    1999, 1995, 1980,
    1999, 1995, 1998,
    1999, 1995, 1999,
    1999, 1995, 1999,
    1999, 1990, 1999,
    1999, 1982, 1999,
    1999, 1970, 1999,
    1999, 1955, 1999,
    1999, 1937, 1999,
    1999, 1917, 1999,
    1999, 1895, 1999,
    1998, 1874, 1999,
    1980, 1852, 1999,
    1938, 1832, 1999,
    1875, 1814, 1999,
    1799, 1798, 1999,
    1715, 1785, 1999,
    1633, 1776, 1999,
    1559, 1771, 1999,
    1503, 1770, 1999,
    1468, 1770, 1999,
    1457, 1770, 1999,
    1457, 1770, 1999,
    1457, 1771, 1999,
    1457, 1776, 1999,
    1457, 1785, 1999,
    1457, 1798, 1999,
    1457, 1813, 1999,
    1457, 1832, 1999,
    1457, 1852, 1999,
    1457, 1873, 1999,
    1457, 1895, 1999,
    1457, 1917, 1999,
    1457, 1937, 1999,
    1457, 1955, 1999,
    1457, 1970, 1999,
    1457, 1982, 1999,
    1457, 1990, 1999,
    1457, 1995, 1996,
    1458, 1995, 1971,
    1472, 1995, 1926,
    1510, 1995, 1879,
    1570, 1995, 1847,
    1645, 1995, 1839,
};

static const gait_table_t gait_table = {
    0x1006ab76, /* hash */
    250000u, /* period, us */
    20000u, /* frame, us */
    64, /* samples */
    3, /* servos */
    2, /* LED pin */
    gait_servos,
    gait_pulses_us,
};

#endif
