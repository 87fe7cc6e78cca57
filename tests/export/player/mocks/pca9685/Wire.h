/* Arduino's Wire with a PCA9685 on it, as its datasheet (Rev. 4) describes it: registers that count up where
 * MODE1 says so, PRE_SCALE that can be set only asleep, and a full OFF that wins over the steps. */
#pragma once
#include <cstdint>
#include <cstdio>
#include <cstdlib>

struct MockPca9685 {
    uint8_t registers[256] = {0x11, 0x04}; /* after power-up: asleep, ALLCALL */
    void put(uint8_t address, uint8_t value)
    {
        if (address == 0xFE && !(registers[0] & 0x10)) {
            return;
        }
        registers[address] = value;
        if (address >= 0xFA && address <= 0xFD) { /* ALL_LED */
            for (int output = 0; output < 16; output++) {
                registers[6 + 4 * output + address - 0xFA] = value;
            }
        }
    }
    /* Steps of the pulse of an output; 0 for none. */
    unsigned steps(int output) const
    {
        const uint8_t *led = registers + 6 + 4 * output;
        if ((registers[0] & 0x10) || (led[3] & 0x10)) {
            return 0;
        }
        if (led[0] || led[1]) {
            std::puts("pulse that does not begin with the frame");
            std::exit(1);
        }
        return led[2] + 256u * (led[3] & 0x0F);
    }
};
inline MockPca9685 mock_pca9685;

struct MockWire {
    uint8_t words[32];
    int count = -1;
    unsigned long hertz = 0;
    void begin() {}
    void setClock(unsigned long clock) { hertz = clock; }
    void beginTransmission(uint8_t address)
    {
        if (address != 0x40) {
            std::puts("no device answers");
            std::exit(1);
        }
        count = 0;
    }
    void write(uint8_t word)
    {
        if (count < 0 || count == 32) {
            std::puts("write outside a transmission, or too long for Wire");
            std::exit(1);
        }
        words[count++] = word;
    }
    uint8_t endTransmission()
    {
        const bool counts_up = mock_pca9685.registers[0] & 0x20;
        for (int i = 1; i < count; i++) {
            mock_pca9685.put((uint8_t)(words[0] + (counts_up ? i - 1 : 0)), words[i]);
        }
        count = -1;
        return 0;
    }
};
inline MockWire Wire;
