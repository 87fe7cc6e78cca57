// Plays table.h on the servos of a PCA9685 at I2C address 0x40. Type into the serial monitor (115200 baud): g to
// go, s to stop in the start pose, r to release the servos. Other pins of the bus: Wire.begin(sda, scl) below.
// All numbers of the PCA9685 are from its datasheet: NXP, PCA9685, Rev. 4.

#include <Wire.h>

#include "table.h"

static const uint8_t ADDRESS = 0x40;               // address bridges all open (section 7.1.1)
static const uint8_t MODE1 = 0x00, MODE2 = 0x01;   // registers (table 4)
static const uint8_t PRE_SCALE = 0xFE, ALL_LED_OFF_H = 0xFD, LED0_ON_L = 0x06;
static const uint8_t SLEEP = 0x10, AUTO_INCREMENT = 0x20; // bits of MODE1 (section 7.3.1)
static const uint8_t TOTEM_POLE = 0x04;            // bit of MODE2 (section 7.3.2)
static const uint8_t FULL_OFF = 0x10;              // bit of OFF high: no pulse (section 7.3.3)
static const uint32_t CLOCKS_PER_US = 25;          // internal oscillator, 25 MHz (section 2)
static const uint32_t STEPS = 4096;                // of a frame (section 7.3.3)

static gait_player_t player;

static void set_register(uint8_t address, uint8_t value)
{
    Wire.beginTransmission(ADDRESS);
    Wire.write(address);
    Wire.write(value);
    Wire.endTransmission();
}

// PRE_SCALE + 1: clocks of the oscillator a step (section 7.3.5).
static uint32_t divider()
{
    return (CLOCKS_PER_US * gait_table.frame_us + STEPS / 2) / STEPS;
}

static void servo_write(uint8_t servo, uint32_t pulse_us)
{
    const uint32_t nearest = (CLOCKS_PER_US * pulse_us + divider() / 2) / divider();
    const uint32_t steps = nearest < STEPS ? nearest : STEPS - 1;
    Wire.beginTransmission(ADDRESS);
    Wire.write((uint8_t)(LED0_ON_L + 4 * gait_servos[servo].pin));
    Wire.write((uint8_t)0);
    Wire.write((uint8_t)0);
    Wire.write((uint8_t)(steps & 0xFF));
    Wire.write(pulse_us == 0 ? FULL_OFF : (uint8_t)(steps >> 8));
    Wire.endTransmission();
}

void setup()
{
    Serial.begin(115200);
    Wire.begin();
    Wire.setClock(400000);
    set_register(ALL_LED_OFF_H, FULL_OFF);
    if (!gait_init(&player, &gait_table) || divider() < 4 || divider() > 256) {
        player.table = NULL;
        Serial.println("table.h cannot be played");
        return;
    }
    set_register(MODE1, SLEEP); // PRE_SCALE can be set only asleep (section 7.3.5)
    set_register(PRE_SCALE, (uint8_t)(divider() - 1));
    set_register(MODE2, TOTEM_POLE);
    set_register(MODE1, AUTO_INCREMENT);
    delay(1); // the oscillator starts within 0.5 ms (section 7.3.1)
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
            for (uint8_t servo = 0; servo < gait_table.servos; servo++) {
                servo_write(servo, 0);
            }
            break;
        default:
            break;
        }
    }
    if (gait_tick(&player, micros())) {
        for (uint8_t servo = 0; servo < gait_table.servos; servo++) {
            servo_write(servo, player.pulse_us[servo]);
        }
        if (gait_table.led_pin >= 0) {
            digitalWrite((uint8_t)gait_table.led_pin, gait_led(&player) ? HIGH : LOW);
        }
    }
}
