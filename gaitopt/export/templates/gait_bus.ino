// Plays table.h on servos of a bus, from Serial1 of an ESP32 through a half-duplex adapter. Type into the serial
// monitor (115200 baud): g to go, s to stop in the start pose, r to release the servos.

#include "bus_packets.h"
#include "table.h"

static const int RX_PIN = 16, TX_PIN = 17; // of Serial1

static gait_player_t player;
static uint8_t ids[BUS_SERVOS];
static uint8_t packet[BUS_PACKET];
static uint8_t energised = 0;

static void release_all()
{
    Serial1.write(packet, bus_torque(GAIT_BUS, ids, (uint8_t)gait_table.servos, false, packet));
    energised = 0;
}

static void send()
{
    uint8_t count = 0;
    while (count < gait_table.servos && player.pulse_us[count] != 0) {
        count++;
    }
    if (count > energised) {
        const uint8_t fresh = (uint8_t)(count - energised);
        Serial1.write(packet, bus_torque(GAIT_BUS, ids + energised, fresh, true, packet));
        energised = count;
    }
    if (count > 0) {
        Serial1.write(packet, bus_positions(GAIT_BUS, ids, player.pulse_us, count, packet));
    }
}

void setup()
{
    Serial.begin(115200);
    if (!gait_init(&player, &gait_table)) {
        Serial.println("table.h cannot be played");
        return;
    }
    for (uint8_t servo = 0; servo < gait_table.servos; servo++) {
        ids[servo] = (uint8_t)gait_servos[servo].pin;
    }
    Serial1.begin(bus_baud(GAIT_BUS), SERIAL_8N1, RX_PIN, TX_PIN);
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
            release_all();
            break;
        default:
            break;
        }
    }
    if (gait_tick(&player, micros())) {
        send();
        if (gait_table.led_pin >= 0) {
            digitalWrite((uint8_t)gait_table.led_pin, gait_led(&player) ? HIGH : LOW);
        }
    }
}
