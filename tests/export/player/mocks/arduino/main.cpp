/* Runs the sketch at the commands of mock_at; prints every change. */
#include "Arduino.h"

void setup();
void loop();

#include "gait.ino"

int main()
{
    uint32_t last[64] = {};
    setup();
    std::printf("%d Hz, %d bits\n", mock_hertz, mock_bits);
    for (uint32_t ms = 0; ms <= 3500; ms++) {
        mock_at(ms);
        loop();
        for (int pin = 0; pin < 64; pin++) {
            const uint32_t now = mock_duty[pin] + 100000u * mock_level[pin];
            if (now != last[pin]) {
                std::printf("%u ms: GPIO%d %u\n", static_cast<unsigned>(ms), pin, static_cast<unsigned>(now));
                last[pin] = now;
            }
        }
    }
    return 0;
}
