/* Plays table.h on LEDC from an esp_timer. Call gait_servos_init() once. The rest may be called from
 * any task; it is heard at the next tick, within 5 ms. */
#ifndef GAIT_SERVOS_H
#define GAIT_SERVOS_H

#include <stdint.h>

#include "esp_err.h"

#ifdef __cplusplus
extern "C" {
#endif

esp_err_t gait_servos_init(void);
void gait_servos_start(void);
void gait_servos_stop(void);    /* ramp out, hold the start pose */
void gait_servos_release(void); /* no more pulses */
void gait_servos_set_period(uint32_t period_us);

#ifdef __cplusplus
}
#endif

#endif
