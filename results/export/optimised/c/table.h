/* The gait best as pulse widths. Made by gaitopt export; gaitopt reads this file back as the gait.
 * Include it in one source file.
 *
 * gaitopt-table: {"format": 1, "hash": "25bb093b06a5a2f4", "name": "best", "period_us": 251686, "frame_us": 20000, "led_pin": 2, "gait": {"period_s": 0.2516860205703769, "channels": {"mid_act": {"duty": 0.5757288237901833, "phase": 0.0, "amplitude_deg": 57.10222711154038, "offset_deg": 32.663244205440925, "smoothing": 0.36959781733696695}, "foot1": {"duty": 0.3348349302915641, "phase": 0.5161719685232029, "amplitude_deg": -20.176735458339067, "offset_deg": -0.11140636147059979, "smoothing": 0.7651739463824108}, "foot2": {"duty": 0.3594753971981357, "phase": 0.06980588156501566, "amplitude_deg": -13.92981466325142, "offset_deg": -0.049436287900121556, "smoothing": 0.0023977790241458824}}}, "servos": {"mid_act": {"pin": 12, "neutral_us": 1000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot1": {"pin": 13, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot2": {"pin": 14, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}}, "start_us": [1000, 2000, 2000], "slew_us": [0, 0, 0]}
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
    1679, 1999, 1845,
    1777, 1999, 1845,
    1864, 1999, 1845,
    1934, 1999, 1845,
    1979, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1845,
    1996, 1999, 1993,
    1996, 1999, 1999,
    1996, 1999, 1999,
    1996, 1999, 1999,
    1996, 1998, 1999,
    1996, 1995, 1999,
    1996, 1989, 1999,
    1996, 1978, 1999,
    1996, 1964, 1999,
    1996, 1947, 1999,
    1996, 1928, 1999,
    1996, 1907, 1999,
    1996, 1886, 1999,
    1995, 1865, 1999,
    1974, 1844, 1999,
    1925, 1825, 1999,
    1852, 1809, 1999,
    1762, 1795, 1999,
    1664, 1784, 1999,
    1568, 1778, 1999,
    1482, 1775, 1999,
    1416, 1775, 1999,
    1375, 1775, 1999,
    1363, 1775, 1999,
    1363, 1775, 1999,
    1363, 1775, 1999,
    1363, 1776, 1999,
    1363, 1782, 1999,
    1363, 1791, 1999,
    1363, 1803, 1999,
    1363, 1819, 1999,
    1363, 1837, 1999,
    1363, 1857, 1999,
    1363, 1878, 1999,
    1363, 1900, 1999,
    1363, 1921, 1999,
    1363, 1940, 1999,
    1363, 1958, 1999,
    1363, 1973, 1999,
    1363, 1985, 1999,
    1363, 1993, 1999,
    1380, 1998, 1850,
    1425, 1999, 1845,
    1495, 1999, 1845,
    1582, 1999, 1845,
};

static const gait_table_t gait_table = {
    0x25bb093b, /* hash */
    251686u, /* period, us */
    20000u, /* frame, us */
    64, /* samples */
    3, /* servos */
    2, /* LED pin */
    gait_servos,
    gait_pulses_us,
};

#endif
