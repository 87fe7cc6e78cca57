/* Plays script.h on table.h and prints a line for every step: what play_script.py does in Python. */
#include <stdio.h>

#include "gait_player.h"
#include "script.h"
#include "table.h"

static gait_player_t player;

static void step(char what, uint32_t value)
{
    bool due = false;

    switch (what) {
    case 'g':
        gait_start(&player, value);
        break;
    case 's':
        gait_stop(&player);
        break;
    case 'r':
        gait_release(&player);
        break;
    case 'p':
        gait_set_period(&player, value);
        break;
    default:
        due = gait_tick(&player, value);
        break;
    }
    printf("%c %d %d %d", what, due ? 1 : 0, (int)player.state, gait_led(&player) ? 1 : 0);
    for (int servo = 0; servo < gait_table.servos; servo++) {
        const uint16_t pulse_us = player.pulse_us[servo];
        printf(" %u/%u", (unsigned)pulse_us, (unsigned)gait_duty(&gait_table, pulse_us));
    }
    printf("\n");
}

int main(void)
{
    gait_init(&player, &gait_table);
    for (size_t i = 0; i < sizeof script / sizeof script[0]; i++) {
        step(script[i].what, script[i].value);
    }
    return 0;
}
