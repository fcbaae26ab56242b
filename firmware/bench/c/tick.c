/* One control tick as crates/core runs it: MRPI inverse (eq. 13), PI with anti-windup (eq. 14), limiter, converter codes.
 *
 * The same formulas in the same order as core; with -ffp-contract=off it gives the same codes, bit by bit. Compiled several
 * times: PLAYS, NAME and PREFIX are given on the command line. */
#include <stdint.h>

struct tick {
    /* what does not change */
    float thresholds[PLAYS], weights[PLAYS];
    float offset, cubic, linear, alpha_s, beta_s, input_min, input_max, rate_hz;
    float proportional, integral_a_sample;
    float output_min, output_max, largest_change;
    float dac_min, codes_per_v, adc_min, um_per_code;
    float feedback_weight;
    /* what does */
    float outputs[PLAYS];
    float last_input, integral, last_command;
    uint32_t started;
};

static inline float larger(float a, float b) { return a > b ? a : b; }
static inline float smaller(float a, float b) { return a < b ? a : b; }
static inline float magnitude(float a) { return a < 0 ? -a : a; }
static inline int finite(float a) { return magnitude(a) <= 3.40282347e38f; }

uint16_t NAME(struct tick *t, uint32_t adc, float reference)
{
    float measured = t->adc_min + (float)adc * t->um_per_code;

    /* the inverse */
    int good = finite(reference);
    float input = smaller(larger(t->input_min, good ? reference : t->last_input), t->input_max);
    float last = t->started ? t->last_input : input;
    float speed = magnitude((input - last) * t->rate_hz);
    float left = input - t->alpha_s * speed, right = input + t->beta_s * speed;
    t->last_input = input;
    t->started |= good;
#if PREFIX
    if (right < t->outputs[0]) {
        for (int i = 0; i < PLAYS && right < t->outputs[i]; i++) t->outputs[i] = right;
    } else {
        for (int i = 0; i < PLAYS; i++) {
            float pushed = left - t->thresholds[i];
            if (pushed < t->outputs[i]) break;
            t->outputs[i] = pushed;
        }
    }
#else
    for (int i = 0; i < PLAYS; i++) t->outputs[i] = larger(left - t->thresholds[i], smaller(right, t->outputs[i]));
#endif
    float even = 0, odd = 0;
    for (int i = 0; i + 1 < PLAYS; i += 2) {
        even += t->weights[i] * t->outputs[i];
        odd += t->weights[i + 1] * t->outputs[i + 1];
    }
    float feedforward = t->offset + ((t->cubic * input * input + t->linear) * input + (even + odd));

    /* the feedback */
    float lowest = larger(t->output_min, t->last_command - t->largest_change);
    float highest = smaller(t->output_max, t->last_command + t->largest_change);
    float error = (reference - measured) * t->feedback_weight;
    if (!(magnitude(error) <= 1e25f)) error = 0;
    float proportional = t->proportional * error;
    float wanted = t->integral + t->integral_a_sample * error;
    float integral = error > 0 ? smaller(wanted, larger(t->integral, highest - feedforward - proportional))
                               : larger(wanted, smaller(t->integral, lowest - feedforward - proportional));
    if (magnitude(integral) <= 1e37f) t->integral = integral;

    /* the limiter */
    float command = feedforward + (proportional + t->integral);
    command = smaller(larger(lowest, finite(command) ? command : t->last_command), highest);
    t->last_command = command;
    float code = (command - t->dac_min) * t->codes_per_v + 0.5f;
    return code <= 0 ? 0 : code >= 65535 ? 65535 : (uint16_t)code;
}
