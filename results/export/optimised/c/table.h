/* The gait best as pulse widths. Made by gaitopt export; gaitopt reads this file back as the gait.
 * Include it in one source file.
 *
 * gaitopt-table: {"format": 1, "hash": "890bde381528571c", "name": "best", "period_us": 250023, "frame_us": 20000, "led_pin": 2, "gait": {"period_s": 0.25002273898334787, "channels": {"mid_act": {"duty": 0.546615143627468, "phase": 0.0, "amplitude_deg": 45.17242362616356, "offset_deg": 44.82757637383644, "smoothing": 0.2840370410454007}, "foot1": {"duty": 0.27949002898801323, "phase": 0.5433342814963862, "amplitude_deg": -17.108188130544136, "offset_deg": -0.4677091630587995, "smoothing": 0.7956178808631792}, "foot2": {"duty": 0.3776080757242467, "phase": 0.03384340098086324, "amplitude_deg": -8.003845132734114, "offset_deg": -0.21444109493218377, "smoothing": 0.18538798240224044}}}, "servos": {"mid_act": {"pin": 12, "neutral_us": 1000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot1": {"pin": 13, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot2": {"pin": 14, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}}, "start_us": [1000, 2000, 2000], "slew_us": [0, 0, 0]}
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
    1748, 1995, 1909,
    1841, 1995, 1909,
    1920, 1995, 1909,
    1975, 1995, 1909,
    1998, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1909,
    1999, 1995, 1910,
    1999, 1995, 1925,
    1999, 1995, 1953,
    1999, 1993, 1981,
    1999, 1986, 1996,
    1999, 1976, 1998,
    1999, 1962, 1998,
    1999, 1945, 1998,
    1999, 1925, 1998,
    1999, 1905, 1998,
    1999, 1884, 1998,
    1997, 1864, 1998,
    1974, 1845, 1998,
    1919, 1830, 1998,
    1840, 1817, 1998,
    1747, 1809, 1998,
    1654, 1805, 1998,
    1575, 1805, 1998,
    1521, 1805, 1998,
    1499, 1805, 1998,
    1498, 1805, 1998,
    1498, 1807, 1998,
    1498, 1814, 1998,
    1498, 1825, 1998,
    1498, 1840, 1998,
    1498, 1857, 1998,
    1498, 1877, 1998,
    1498, 1897, 1998,
    1498, 1918, 1998,
    1498, 1938, 1998,
    1498, 1956, 1998,
    1498, 1972, 1998,
    1498, 1983, 1998,
    1498, 1991, 1998,
    1498, 1995, 1998,
    1498, 1995, 1998,
    1498, 1995, 1998,
    1498, 1995, 1998,
    1498, 1995, 1998,
    1498, 1995, 1998,
    1499, 1995, 1995,
    1522, 1995, 1977,
    1576, 1995, 1948,
    1656, 1995, 1921,
};

static const gait_table_t gait_table = {
    0x890bde38, /* hash */
    250023u, /* period, us */
    20000u, /* frame, us */
    64, /* samples */
    3, /* servos */
    2, /* LED pin */
    gait_servos,
    gait_pulses_us,
};

#endif
