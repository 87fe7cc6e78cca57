#include "gait_player.h"

#include <stddef.h>

/* 2^64 / divisor, rounded down (0 for 1), by long division: no 64-bit divider is linked in. */
static uint64_t reciprocal(uint32_t divisor)
{
    uint64_t quotient = 0, rest = 1;
    for (int bit = 0; bit < 64; bit++) {
        rest <<= 1;
        quotient <<= 1;
        if (rest >= divisor) {
            rest -= divisor;
            quotient |= 1;
        }
    }
    return quotient;
}

/* From one pulse to another, weight 0 to 2^16, rounded to the nearest. */
static uint32_t blend(uint32_t from, uint32_t to, uint32_t weight)
{
    return (from * (UINT32_C(65536) - weight) + to * weight + UINT32_C(32768)) >> 16;
}

static uint32_t clamp(uint32_t value, uint32_t low, uint32_t high)
{
    return value < low ? low : value > high ? high : value;
}

static uint32_t all_energised_us(const gait_table_t *table)
{
    return table->servos * GAIT_STAGGER_US;
}

/* Let time pass, in whole frames. */
static void advance(gait_player_t *player, uint32_t passed_us)
{
    const uint32_t all_us = all_energised_us(player->table);

    switch (player->state) {
    case GAIT_ENERGISING:
        if (passed_us < all_us - player->energised_us) {
            player->energised_us += passed_us;
            return;
        }
        player->energised_us = all_us;
        player->state = GAIT_WALKING;
        player->phase = 0;
        player->ramp_us = 0;
        return;
    case GAIT_WALKING:
        player->phase += passed_us * player->phase_per_us;
        player->ramp_us += clamp(passed_us, 0, GAIT_RAMP_US - player->ramp_us);
        return;
    case GAIT_STOPPING:
        player->phase += passed_us * player->phase_per_us;
        player->ramp_us -= clamp(passed_us, 0, player->ramp_us);
        if (player->ramp_us == 0) {
            player->state = GAIT_HOLDING;
        }
        return;
    case GAIT_OFF:
    case GAIT_HOLDING:
        return;
    }
}

/* The table's pulse at the player's phase. */
static uint32_t wave(const gait_player_t *player, uint32_t servo)
{
    const gait_table_t *table = player->table;
    const uint64_t position = (player->phase >> 32) * table->samples;
    const uint32_t row = (uint32_t)(position >> 32);
    const uint32_t next = row + 1 == table->samples ? 0 : row + 1;
    const uint32_t between = (uint32_t)(position >> 16) & UINT32_C(0xffff);

    return blend(table->pulse_us[row * table->servos + servo],
                 table->pulse_us[next * table->servos + servo], between);
}

static uint16_t next_pulse(const gait_player_t *player, uint32_t servo)
{
    const gait_servo_t *limits = &player->table->servo[servo];
    const uint32_t last = player->pulse_us[servo];
    uint32_t pulse = blend(limits->start_us, wave(player, servo), player->ramp_us >> 4);

    pulse = clamp(pulse, limits->min_us, limits->max_us);
    if (last != 0 && limits->slew_us != 0) {
        const uint32_t low = last > limits->slew_us ? last - limits->slew_us : 0;
        pulse = clamp(pulse, low, last + limits->slew_us);
    }
    return (uint16_t)pulse;
}

static bool playable(const gait_table_t *table)
{
    if (table == NULL || table->servo == NULL || table->pulse_us == NULL || table->period_us == 0 ||
        table->frame_us == 0 || table->samples == 0 || table->servos == 0 || table->servos > GAIT_MAX_SERVOS) {
        return false;
    }
    for (uint32_t servo = 0; servo < table->servos; servo++) {
        const gait_servo_t *limits = &table->servo[servo];
        if (limits->min_us == 0 || limits->min_us > limits->max_us) {
            return false;
        }
    }
    return true;
}

bool gait_init(gait_player_t *player, const gait_table_t *table)
{
    player->table = playable(table) ? table : NULL;
    player->phase = 0;
    player->phase_per_us = player->table == NULL ? 0 : reciprocal(table->period_us);
    player->frame_at_us = 0;
    gait_release(player);
    return player->table != NULL;
}

void gait_start(gait_player_t *player, uint32_t now_us)
{
    if (player->table == NULL) {
        return;
    }
    if (player->state == GAIT_STOPPING) {
        player->state = GAIT_WALKING;
    } else if (player->state != GAIT_WALKING && player->state != GAIT_ENERGISING) {
        player->state = GAIT_ENERGISING;
        player->frame_at_us = now_us - player->table->frame_us;
    }
}

void gait_stop(gait_player_t *player)
{
    if (player->state == GAIT_WALKING) {
        player->state = GAIT_STOPPING;
    } else if (player->state == GAIT_ENERGISING) {
        gait_release(player);
    }
}

void gait_release(gait_player_t *player)
{
    player->state = GAIT_OFF;
    player->ramp_us = 0;
    player->energised_us = 0;
    for (uint32_t servo = 0; servo < GAIT_MAX_SERVOS; servo++) {
        player->pulse_us[servo] = 0;
    }
}

void gait_set_period(gait_player_t *player, uint32_t period_us)
{
    if (period_us != 0) {
        player->phase_per_us = reciprocal(period_us);
    }
}

bool gait_tick(gait_player_t *player, uint32_t now_us)
{
    const gait_table_t *table = player->table;
    uint32_t passed_us = now_us - player->frame_at_us;

    if (table == NULL || passed_us < table->frame_us) {
        return false;
    }
    passed_us -= passed_us % table->frame_us;
    player->frame_at_us += passed_us;
    advance(player, passed_us);
    for (uint32_t servo = 0; servo < table->servos; servo++) {
        if (player->energised_us > servo * GAIT_STAGGER_US) {
            player->pulse_us[servo] = next_pulse(player, servo);
        }
    }
    return true;
}

bool gait_led(const gait_player_t *player)
{
    return player->state == GAIT_WALKING;
}

uint32_t gait_duty(const gait_table_t *table, uint16_t pulse_us)
{
    if (table->frame_us == 0) {
        return 0;
    }
    return (((uint32_t)pulse_us << GAIT_DUTY_BITS) + table->frame_us / 2) / table->frame_us;
}
