/* Runs the component for half a second of its timer and prints every duty that it sets. */
#include <stdio.h>

#include "driver/gpio.h"
#include "driver/ledc.h"
#include "esp_timer.h"
#include "gait_servos.h"

static esp_timer_create_args_t timer;
static int64_t now_us = 4294900000;
static uint64_t period_us;

int64_t esp_timer_get_time(void) { return now_us; }

esp_err_t esp_timer_create(const esp_timer_create_args_t *create_args, esp_timer_handle_t *out_handle)
{
    timer = *create_args;
    *out_handle = NULL;
    return ESP_OK;
}

esp_err_t esp_timer_start_periodic(esp_timer_handle_t handle, uint64_t period)
{
    (void)handle;
    period_us = period;
    return ESP_OK;
}

esp_err_t gpio_set_direction(gpio_num_t pin, gpio_mode_t mode)
{
    printf("GPIO%d mode %d\n", pin, (int)mode);
    return ESP_OK;
}

esp_err_t gpio_set_level(gpio_num_t pin, uint32_t level)
{
    printf("GPIO%d %u\n", pin, (unsigned)level);
    return ESP_OK;
}

esp_err_t ledc_timer_config(const ledc_timer_config_t *config)
{
    printf("%u Hz, %d bits\n", (unsigned)config->freq_hz, (int)config->duty_resolution);
    return ESP_OK;
}

esp_err_t ledc_channel_config(const ledc_channel_config_t *config)
{
    printf("channel %d GPIO%d\n", (int)config->channel, config->gpio_num);
    return ESP_OK;
}

esp_err_t ledc_set_duty(ledc_mode_t mode, ledc_channel_t channel, uint32_t duty)
{
    (void)mode;
    printf("channel %d %u\n", (int)channel, (unsigned)duty);
    return ESP_OK;
}

esp_err_t ledc_update_duty(ledc_mode_t mode, ledc_channel_t channel)
{
    (void)mode;
    (void)channel;
    return ESP_OK;
}

int main(void)
{
    if (gait_servos_init() != ESP_OK) {
        return 1;
    }
    gait_servos_start();
    for (int tick = 0; tick < 400; tick++) {
        timer.callback(timer.arg);
        now_us += (int64_t)period_us;
    }
    return 0;
}
