float @name@_due_um(const @name@_state *state) { return state->due_um; }

int @name@_limited(const @name@_state *state) { return state->asked_v != state->last_v; }

uint16_t @name@_dac_code(float volts) {
    float code = (volts - DAC[0]) * DAC[2] + 0.5f;
    if (!(code > 0.0f)) {
        return 0;
    }
    return code >= 65535.0f ? 65535 : (uint16_t)code;
}

float @name@_adc_um(uint16_t code) { return ADC[0] + (float)code * ADC[1]; }
