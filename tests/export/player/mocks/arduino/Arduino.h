/* What the sketch uses of the ESP32's Arduino core, core 2 or core 3 by ESP_ARDUINO_VERSION_MAJOR, and
 * no more: the other core's functions do not exist. Signatures as in esp32-hal-ledc.h. */
#pragma once
#include <cstdint>
#include <cstdio>
#include <string>

constexpr uint8_t OUTPUT = 3, HIGH = 1, LOW = 0;

inline uint32_t mock_micros = 0;
inline std::string mock_typed;
inline int mock_hertz = 0, mock_bits = 0;
inline uint32_t mock_duty[64] = {};
inline uint8_t mock_level[64] = {};

/* Three and a half seconds across the clock's wrap: g to go, s after two seconds, r near the end. */
inline void mock_at(uint32_t ms)
{
    mock_micros = 4294000000u + 1000 * ms;
    if (ms == 0 || ms == 2000 || ms == 3400) {
        mock_typed = ms == 0 ? "g" : ms == 2000 ? "s" : "r";
    }
}

inline unsigned long micros() { return mock_micros; }
inline void pinMode(uint8_t, uint8_t) {}
inline void digitalWrite(uint8_t pin, uint8_t level) { mock_level[pin] = level; }

#if ESP_ARDUINO_VERSION_MAJOR >= 3
inline bool ledcAttach(uint8_t, uint32_t hertz, uint8_t bits)
{
    mock_hertz = static_cast<int>(hertz);
    mock_bits = bits;
    return true;
}
inline bool ledcWrite(uint8_t pin, uint32_t duty)
{
    mock_duty[pin] = duty;
    return true;
}
#else
inline uint8_t mock_pin[16] = {};
inline uint32_t ledcSetup(uint8_t, uint32_t hertz, uint8_t bits)
{
    mock_hertz = static_cast<int>(hertz);
    mock_bits = bits;
    return hertz;
}
inline void ledcAttachPin(uint8_t pin, uint8_t channel) { mock_pin[channel] = pin; }
inline void ledcWrite(uint8_t channel, uint32_t duty) { mock_duty[mock_pin[channel]] = duty; }
#endif

struct MockSerial {
    void begin(unsigned long) {}
    void println(const char *line) { std::puts(line); }
    int available() { return static_cast<int>(mock_typed.size()); }
    int read()
    {
        const char typed = mock_typed.front();
        mock_typed.erase(0, 1);
        return typed;
    }
};
inline MockSerial Serial;
