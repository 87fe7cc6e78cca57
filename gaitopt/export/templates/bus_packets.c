#include "bus_packets.h"

enum { BROADCAST = 0xFE, SYNC_WRITE = 0x83 };

static uint16_t crc16(const uint8_t *bytes, uint8_t count)
{
    uint16_t crc = 0;
    for (uint8_t i = 0; i < count; i++) {
        crc = (uint16_t)(crc ^ (uint16_t)(bytes[i] << 8));
        for (uint8_t bit = 0; bit < 8; bit++) {
            crc = (uint16_t)((crc & 0x8000) != 0 ? (crc << 1) ^ 0x8005 : crc << 1);
        }
    }
    return crc;
}

/* Write what comes before the data; return its length. */
static uint8_t begin(bus_protocol_t protocol, uint8_t address, uint8_t size, uint8_t count, uint8_t *packet)
{
    const uint8_t data = (uint8_t)(count * (size + 1));
    const uint8_t feetech[] = {0xFF, 0xFF, BROADCAST, (uint8_t)(data + 4), SYNC_WRITE, address, size};
    const uint8_t dynamixel[] = {0xFF, 0xFF, 0xFD, 0, BROADCAST, (uint8_t)(data + 7), 0, SYNC_WRITE,
                                 address, 0, size, 0};
    const bool two = protocol == BUS_DYNAMIXEL;
    const uint8_t length = (uint8_t)(two ? sizeof dynamixel : sizeof feetech);
    for (uint8_t i = 0; i < length; i++) {
        packet[i] = two ? dynamixel[i] : feetech[i];
    }
    return length;
}

/* Write the checksum; return the length of the whole packet. */
static uint8_t end(bus_protocol_t protocol, uint8_t *packet, uint8_t length)
{
    if (protocol == BUS_DYNAMIXEL) {
        const uint16_t crc = crc16(packet, length);
        packet[length++] = (uint8_t)(crc & 0xFF);
        packet[length++] = (uint8_t)(crc >> 8);
        return length;
    }
    uint8_t sum = 0;
    for (uint8_t i = 2; i < length; i++) {
        sum = (uint8_t)(sum + packet[i]);
    }
    packet[length++] = (uint8_t)(~sum & 0xFF);
    return length;
}

uint32_t bus_baud(bus_protocol_t protocol)
{
    return protocol == BUS_DYNAMIXEL ? 57600 : 1000000;
}

uint8_t bus_torque(bus_protocol_t protocol, const uint8_t *ids, uint8_t count, bool on, uint8_t *packet)
{
    const uint8_t address = protocol == BUS_DYNAMIXEL ? 64 : 40;
    count = count > BUS_SERVOS ? BUS_SERVOS : count;
    uint8_t length = begin(protocol, address, 1, count, packet);
    for (uint8_t i = 0; i < count; i++) {
        packet[length++] = ids[i];
        packet[length++] = on ? 1 : 0;
    }
    return end(protocol, packet, length);
}

uint8_t bus_positions(bus_protocol_t protocol, const uint8_t *ids, const uint16_t *steps, uint8_t count,
                      uint8_t *packet)
{
    const bool two = protocol == BUS_DYNAMIXEL;
    count = count > BUS_SERVOS ? BUS_SERVOS : count;
    uint8_t length = begin(protocol, two ? 116 : 42, two ? 4 : 2, count, packet);
    for (uint8_t i = 0; i < count; i++) {
        const uint8_t low = (uint8_t)(steps[i] & 0xFF), high = (uint8_t)(steps[i] >> 8);
        const bool high_first = protocol == BUS_FEETECH_SCS;
        packet[length++] = ids[i];
        packet[length++] = high_first ? high : low;
        packet[length++] = high_first ? low : high;
        if (two) {
            packet[length++] = 0;
            packet[length++] = 0;
        }
    }
    return end(protocol, packet, length);
}
