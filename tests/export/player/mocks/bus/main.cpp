/* Runs the sketch at the commands of mock_at; prints every packet on the bus. */
#include "Arduino.h"

#include <cstddef>

constexpr uint32_t SERIAL_8N1 = 0x800001c;

inline uint32_t mock_ms = 0;

struct MockBus {
    void begin(unsigned long baud, uint32_t config, int rx, int tx)
    {
        std::printf("%lu baud, %d, RX %d, TX %d\n", baud, config == SERIAL_8N1, rx, tx);
    }
    size_t write(const uint8_t *bytes, size_t count)
    {
        std::printf("%u:", static_cast<unsigned>(mock_ms));
        for (size_t i = 0; i < count; i++) {
            std::printf(" %d", bytes[i]);
        }
        std::puts("");
        return count;
    }
};
inline MockBus Serial1;

void setup();
void loop();

#include "gait.ino"

int main()
{
    setup();
    for (mock_ms = 0; mock_ms <= 3500; mock_ms++) {
        mock_at(mock_ms);
        loop();
    }
    return 0;
}
