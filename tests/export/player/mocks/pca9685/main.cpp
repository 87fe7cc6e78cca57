/* Runs the sketch at the commands of mock_at; prints every change of an output. */
#include "Arduino.h"

inline void delay(unsigned long) {}
#include "Wire.h"

void setup();
void loop();

#include "gait.ino"

int main()
{
    unsigned last[16] = {};
    setup();
    std::printf("%d clocks a step, %lu Hz\n", mock_pca9685.registers[0xFE] + 1, Wire.hertz);
    for (uint32_t ms = 0; ms <= 3500; ms++) {
        mock_at(ms);
        loop();
        for (int output = 0; output < 16; output++) {
            const unsigned now = mock_pca9685.steps(output);
            if (now != last[output]) {
                std::printf("%u ms: %d %u\n", static_cast<unsigned>(ms), output, now);
                last[output] = now;
            }
        }
    }
    return 0;
}
