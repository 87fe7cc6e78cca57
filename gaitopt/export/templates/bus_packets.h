/* Packets of servo buses: Feetech STS and SCS, Dynamixel protocol 2.
 *
 * One packet a frame sets the positions of all servos ("sync write"). It goes to all of them, so none
 * answers. The bytes are those of bus_packets.py; the sources of all numbers are there, too.
 */
#ifndef BUS_PACKETS_H
#define BUS_PACKETS_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define BUS_SERVOS 16  /* in a packet, at most */
#define BUS_PACKET 94  /* bytes of the longest packet: positions of 16 Dynamixels */

typedef enum { BUS_FEETECH_STS, BUS_FEETECH_SCS, BUS_DYNAMIXEL } bus_protocol_t;

/* Baud rate of servos as delivered. */
uint32_t bus_baud(bus_protocol_t protocol);

/* Write the packet that switches the torque of servos on or off; return its length. */
uint8_t bus_torque(bus_protocol_t protocol, const uint8_t *ids, uint8_t count, bool on, uint8_t *packet);

/* Write the packet that moves servos to positions in steps; return its length. */
uint8_t bus_positions(bus_protocol_t protocol, const uint8_t *ids, const uint16_t *steps, uint8_t count,
                      uint8_t *packet);

#ifdef __cplusplus
}
#endif

#endif
