/* Random ticks on random tables: argv is the seed and the number of ticks; exits with 1 at the first pulse
 * outside its servo's range or slew. Every fourth table cannot be played: 1, too, if it is not refused, or if
 * anything is sent of it. Tables lie in memory of their exact size, so that a sanitizer sees every
 * step beside them. */
#include <stdio.h>
#include <stdlib.h>

#include "gait_player.h"

static uint64_t state;

static uint32_t draw(void)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (uint32_t)(state >> 32);
}

static uint32_t below(uint32_t limit)
{
    return draw() % limit;
}

/* A time or period: usual, tiny, huge, or anything. */
static uint32_t span(void)
{
    static const uint32_t edges[] = {1, 2, 19999, 20000, 20001, 1000000, 0x7fffffff, 0x80000000, 0xffffffff};

    switch (below(4)) {
    case 0:
        return edges[below(sizeof edges / sizeof edges[0])];
    case 1:
        return 1 + draw() % 0xffffffff;
    default:
        return 1 + below(60000);
    }
}

static gait_table_t made(void)
{
    const uint16_t servos = (uint16_t)(1 + below(GAIT_MAX_SERVOS));
    const uint16_t samples = (uint16_t)(1 + below(below(8) ? 80 : 1024));
    gait_servo_t *servo = malloc(servos * sizeof *servo);
    uint16_t *pulse_us = malloc((size_t)servos * samples * sizeof *pulse_us);

    for (uint32_t i = 0; i < servos; i++) {
        const uint32_t one = 1 + below(65535), other = 1 + below(65535);
        servo[i].pin = -1;
        servo[i].min_us = (uint16_t)(one < other ? one : other);
        servo[i].max_us = (uint16_t)(one < other ? other : one);
        servo[i].start_us = (uint16_t)below(65536); /* in range or not */
        servo[i].slew_us = (uint16_t)(below(2) ? 0 : below(8) ? 1 + below(3000) : 65535);
    }
    for (size_t i = 0; i < (size_t)servos * samples; i++) {
        pulse_us[i] = (uint16_t)below(65536);
    }
    return (gait_table_t){draw(), span(), below(4) ? 20000 : 1 + below(100000), samples, servos, -1, servo, pulse_us};
}

/* Spoil a table, each time in the next of the ways that the player must refuse; what it points to stays as
 * large as it was. */
static void spoil(gait_table_t *table, unsigned long way)
{
    gait_servo_t *servo = (gait_servo_t *)(uintptr_t)table->servo + below(table->servos);

    switch (way % 8) {
    case 0:
        table->period_us = 0;
        break;
    case 1:
        table->frame_us = 0;
        break;
    case 2:
        table->samples = 0;
        break;
    case 3:
        table->servos = 0;
        break;
    case 4:
        table->servos = GAIT_MAX_SERVOS + 1;
        break;
    case 5:
        table->servos = (uint16_t)(GAIT_MAX_SERVOS + 1 + below(65536 - GAIT_MAX_SERVOS - 1));
        break;
    case 6:
        servo->min_us = (uint16_t)(2 + below(65534));
        servo->max_us = (uint16_t)below(servo->min_us);
        break;
    default:
        servo->min_us = 0;
        break;
    }
}

static int wrong(const gait_player_t *player, const uint16_t *last)
{
    for (uint32_t i = 0; i < GAIT_MAX_SERVOS; i++) {
        const uint32_t pulse = player->pulse_us[i];
        if (player->table == NULL || i >= player->table->servos || player->state == GAIT_OFF) {
            if (pulse != 0) {
                return 1;
            }
            continue;
        }
        const gait_servo_t *servo = &player->table->servo[i];
        const uint32_t change = pulse > last[i] ? pulse - last[i] : last[i] - pulse;
        if (pulse != 0 && (pulse < servo->min_us || pulse > servo->max_us)) {
            return 1;
        }
        if (pulse != 0 && last[i] != 0 && servo->slew_us != 0 && change > servo->slew_us) {
            return 1;
        }
    }
    return 0;
}

int main(int count, char **words)
{
    const unsigned long ticks = count == 3 ? strtoul(words[2], NULL, 10) : 0;
    unsigned long due = 0, wraps = 0, tables = 0, refused = 0;
    gait_player_t player;
    gait_table_t table;
    uint32_t now = 0;

    state = count == 3 ? strtoull(words[1], NULL, 10) * 2654435769u + 1 : 1;
    for (unsigned long tick = 0; tick < ticks; tick++) {
        if (tick % 5000 == 0) {
            if (tick != 0) {
                free((void *)(uintptr_t)table.servo);
                free((void *)(uintptr_t)table.pulse_us);
            }
            table = made();
            tables++;
            const bool bad = tables % 4 == 0;
            if (bad) {
                spoil(&table, refused++);
            }
            if (gait_init(&player, &table) == bad) {
                printf("table %lu is %s\n", tables, bad ? "not refused" : "refused");
                return 1;
            }
            now = below(2) ? 0xffffff00u : draw();
            gait_start(&player, now);
        }
        uint16_t last[GAIT_MAX_SERVOS];
        for (uint32_t i = 0; i < GAIT_MAX_SERVOS; i++) {
            last[i] = player.pulse_us[i];
        }
        switch (below(400)) {
        case 0:
            gait_start(&player, now);
            break;
        case 1:
            gait_stop(&player);
            break;
        case 2:
            gait_release(&player);
            break;
        case 3:
            gait_start(&player, draw());
            break;
        case 4:
        case 5:
            gait_set_period(&player, below(4) ? span() : 0);
            break;
        default: {
            const uint32_t passed = below(50) ? below(2 * table.frame_us + 2) : span();
            wraps += now + passed < now;
            now += passed;
            const bool sent = gait_tick(&player, now);
            if (sent && player.table == NULL) {
                printf("a frame of table %lu, which was refused\n", tables);
                return 1;
            }
            due += sent;
            break;
        }
        }
        if (wrong(&player, last)) {
            printf("tick %lu of table %lu\n", tick, tables);
            return 1;
        }
    }
    if (ticks != 0) {
        free((void *)(uintptr_t)table.servo);
        free((void *)(uintptr_t)table.pulse_us);
    }
    printf("%lu ticks, %lu frames, %lu tables, %lu wraps, %lu refused\n", ticks, due, tables, wraps, refused);
    return 0;
}
