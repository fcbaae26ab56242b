/* A generated law between codes, as the application calls the core's. LAW is its name, HEADER its file. */
#include HEADER

#define JOIN(a, b) a##b
#define NAME(law, what) JOIN(law, what)
#define OF(what) NAME(LAW, what)

/* Bytes of a state, and what they must be aligned to. */
const uint32_t OF(_sizes)[2] = {sizeof(OF(_state)), _Alignof(OF(_state))};

void OF(_begin)(OF(_state) *state) {
    OF(_input) rest = {0};
    OF(_reset)(state, &rest);
}

uint16_t OF(_tick)(OF(_state) *state, uint16_t code, float reference_um) {
    OF(_input) now = {0};
    now.reference_um = reference_um;
    now.measured_um = OF(_adc_um)(code);
    return OF(_dac_code)(OF(_step)(state, &now));
}
