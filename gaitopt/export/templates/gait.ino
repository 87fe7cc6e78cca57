// Plays table.h on the servos of an ESP32 board, with Arduino core 2 or 3. Type into the serial
// monitor (115200 baud): g to go, s to stop in the start pose, r to release the servos.

#include "table.h"

static gait_player_t player;

#if ESP_ARDUINO_VERSION_MAJOR >= 3

static void servo_attach(uint8_t servo, uint32_t hertz)
{
    ledcAttach((uint8_t)gait_servos[servo].pin, hertz, GAIT_DUTY_BITS);
}

static void servo_write(uint8_t servo, uint32_t duty)
{
    ledcWrite((uint8_t)gait_servos[servo].pin, duty);
}

#else

static void servo_attach(uint8_t servo, uint32_t hertz)
{
    ledcSetup(servo, hertz, GAIT_DUTY_BITS);
    ledcAttachPin((uint8_t)gait_servos[servo].pin, servo);
}

static void servo_write(uint8_t servo, uint32_t duty)
{
    ledcWrite(servo, duty);
}

#endif

void setup()
{
    Serial.begin(115200);
    if (!gait_init(&player, &gait_table)) {
        Serial.println("table.h cannot be played");
        return;
    }
    const uint32_t hertz = (1000000u + gait_table.frame_us / 2) / gait_table.frame_us;
    for (uint8_t servo = 0; servo < gait_table.servos; servo++) {
        servo_attach(servo, hertz);
        servo_write(servo, 0);
    }
    if (gait_table.led_pin >= 0) {
        pinMode((uint8_t)gait_table.led_pin, OUTPUT);
    }
}

void loop()
{
    if (Serial.available() > 0) {
        switch (Serial.read()) {
        case 'g':
            gait_start(&player, micros());
            break;
        case 's':
            gait_stop(&player);
            break;
        case 'r':
            gait_release(&player);
            break;
        default:
            break;
        }
    }
    if (gait_tick(&player, micros())) {
        for (uint8_t servo = 0; servo < gait_table.servos; servo++) {
            servo_write(servo, gait_duty(&gait_table, player.pulse_us[servo]));
        }
        if (gait_table.led_pin >= 0) {
            digitalWrite((uint8_t)gait_table.led_pin, gait_led(&player) ? HIGH : LOW);
        }
    }
}
