#include "gait_servos.h"

#include <stdatomic.h>
#include <stddef.h>

#include "driver/gpio.h"
#include "driver/ledc.h"
#include "esp_timer.h"

#include "table.h"

/* Shorter than a frame: a tick that comes a little early must not cost a whole frame. */
#define TICK_US 5000

typedef enum { NOTHING, START, STOP, RELEASE } request_t;

static gait_player_t player;
static atomic_int request;
static atomic_uint period_us;

static void obey(uint32_t now_us)
{
    gait_set_period(&player, atomic_exchange(&period_us, 0));
    switch (atomic_exchange(&request, NOTHING)) {
    case START:
        gait_start(&player, now_us);
        break;
    case STOP:
        gait_stop(&player);
        break;
    case RELEASE:
        gait_release(&player);
        break;
    default:
        break;
    }
}

static void on_tick(void *unused)
{
    (void)unused;
    const uint32_t now_us = (uint32_t)esp_timer_get_time();

    obey(now_us);
    if (!gait_tick(&player, now_us)) {
        return;
    }
    for (int servo = 0; servo < gait_table.servos; servo++) {
        const uint32_t duty = gait_duty(&gait_table, player.pulse_us[servo]);
        ledc_set_duty(LEDC_LOW_SPEED_MODE, (ledc_channel_t)servo, duty);
        ledc_update_duty(LEDC_LOW_SPEED_MODE, (ledc_channel_t)servo);
    }
    if (gait_table.led_pin >= 0) {
        gpio_set_level((gpio_num_t)gait_table.led_pin, gait_led(&player) ? 1 : 0);
    }
}

static esp_err_t attach(int servo)
{
    const ledc_channel_config_t channel = {
        .gpio_num = gait_servos[servo].pin,
        .speed_mode = LEDC_LOW_SPEED_MODE,
        .channel = (ledc_channel_t)servo,
        .timer_sel = LEDC_TIMER_0,
        .duty = 0,
    };
    return ledc_channel_config(&channel);
}

esp_err_t gait_servos_init(void)
{
    if (!gait_init(&player, &gait_table)) {
        return ESP_ERR_INVALID_ARG;
    }
    const ledc_timer_config_t timer = {
        .speed_mode = LEDC_LOW_SPEED_MODE,
        .duty_resolution = LEDC_TIMER_14_BIT,
        .timer_num = LEDC_TIMER_0,
        .freq_hz = (1000000 + gait_table.frame_us / 2) / gait_table.frame_us,
        .clk_cfg = LEDC_AUTO_CLK,
    };
    esp_err_t error = ledc_timer_config(&timer);
    for (int servo = 0; error == ESP_OK && servo < gait_table.servos; servo++) {
        error = attach(servo);
    }
    if (error == ESP_OK && gait_table.led_pin >= 0) {
        error = gpio_set_direction((gpio_num_t)gait_table.led_pin, GPIO_MODE_OUTPUT);
    }

    const esp_timer_create_args_t ticks = {.callback = on_tick, .name = "gait"};
    esp_timer_handle_t handle = NULL;
    if (error == ESP_OK) {
        error = esp_timer_create(&ticks, &handle);
    }
    return error == ESP_OK ? esp_timer_start_periodic(handle, TICK_US) : error;
}

void gait_servos_start(void)
{
    atomic_store(&request, START);
}

void gait_servos_stop(void)
{
    atomic_store(&request, STOP);
}

void gait_servos_release(void)
{
    atomic_store(&request, RELEASE);
}

void gait_servos_set_period(uint32_t new_period_us)
{
    atomic_store(&period_us, new_period_us);
}
