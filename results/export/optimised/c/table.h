/* The gait arcfold as pulse widths. Made by gaitopt export; gaitopt reads this file back as the gait.
 * Include it in one source file.
 *
 * gaitopt-table: {"format": 1, "hash": "1f33aec61b0f0001", "name": "arcfold", "period_us": 250143, "frame_us": 20000, "led_pin": 2, "gait": {"period_s": 0.2501430960449428, "channels": {"mid_act": {"duty": 0.5595040591864547, "phase": 0.0, "amplitude_deg": 67.50820962528698, "offset_deg": 22.42851928470392, "smoothing": 0.23532076024032766}, "foot1": {"duty": 0.5564824618360195, "phase": 0.831158273697485, "amplitude_deg": -27.38640728817704, "offset_deg": -26.377433255156262, "smoothing": 0.33163111548383895}, "foot2": {"duty": 0.5260079492089831, "phase": 0.9671563513125824, "amplitude_deg": -32.20095470898903, "offset_deg": -25.723684305859948, "smoothing": 0.2173961040837234}}}, "servos": {"mid_act": {"pin": 12, "neutral_us": 1000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot1": {"pin": 13, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}, "foot2": {"pin": 14, "neutral_us": 2000.0, "min_us": 500, "max_us": 2500, "us_per_deg": 11.1, "direction": 1, "trim_us": 0.0, "speed_limit_deg_s": 600.0}}, "start_us": [1000, 2000, 2000], "slew_us": [0, 0, 0]}
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
    1624, 1707, 1685,
    1793, 1707, 1624,
    1925, 1707, 1544,
    1991, 1707, 1462,
    1998, 1707, 1397,
    1998, 1707, 1362,
    1998, 1707, 1357,
    1998, 1700, 1357,
    1998, 1677, 1357,
    1998, 1641, 1357,
    1998, 1595, 1357,
    1998, 1545, 1357,
    1998, 1497, 1357,
    1998, 1454, 1357,
    1998, 1423, 1357,
    1998, 1406, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1998, 1403, 1357,
    1984, 1403, 1364,
    1904, 1403, 1404,
    1762, 1403, 1473,
    1590, 1403, 1555,
    1425, 1403, 1634,
    1304, 1403, 1691,
    1252, 1403, 1713,
    1249, 1403, 1714,
    1249, 1403, 1714,
    1249, 1405, 1714,
    1249, 1418, 1714,
    1249, 1446, 1714,
    1249, 1486, 1714,
    1249, 1534, 1714,
    1249, 1584, 1714,
    1249, 1631, 1714,
    1249, 1670, 1714,
    1249, 1696, 1714,
    1249, 1707, 1714,
    1249, 1707, 1714,
    1249, 1707, 1714,
    1249, 1707, 1714,
    1249, 1707, 1714,
    1249, 1707, 1714,
    1249, 1707, 1714,
    1249, 1707, 1714,
    1249, 1707, 1714,
    1249, 1707, 1714,
    1257, 1707, 1714,
    1322, 1707, 1714,
    1454, 1707, 1712,
};

static const gait_table_t gait_table = {
    0x1f33aec6, /* hash */
    250143u, /* period, us */
    20000u, /* frame, us */
    64, /* samples */
    3, /* servos */
    2, /* LED pin */
    gait_servos,
    gait_pulses_us,
};

#endif
