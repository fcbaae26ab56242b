/* One control tick as crates/core runs it: MRPI inverse (eq. 13), PI with anti-windup (eq. 14), limiter, converter codes.
 *
 * The same formulas in the same order as core; with -ffp-contract=off it gives the same codes, bit by bit. Compiled several
 * times: PLAYS, NAME and PREFIX are given on the command line. PREFIX touches the first plays only. */
#include <stdint.h>

struct tick {
    /* what does not change */
    float thresholds[PLAYS], weights[PLAYS];
    float offset, cubic, linear, alpha, beta, input_min, input_max;
    float proportional, integral_a_sample;
    float output_min, output_max, largest_change, usual_change;
    float dac_min, codes_per_v, adc_min, um_per_code;
    /* what does */
    float outputs[PLAYS], sums[PLAYS + 2];
    float last_input, integral, last_command, asked;
    uint32_t fault;
};

static inline float larger(float a, float b) { return a > b ? a : b; }
static inline float smaller(float a, float b) { return a < b ? a : b; }
static inline float magnitude(float a) { return a < 0 ? -a : a; }
static inline int finite(float a) { return magnitude(a) <= 3.40282347e38f; }

uint16_t NAME(struct tick *t, uint16_t adc, float reference)
{
    float measured = t->adc_min + (float)adc * t->um_per_code;

    /* the inverse */
    float input = reference;
    if (!(input >= t->input_min && input <= t->input_max)) {
        if (!finite(input)) {
            input = t->last_input;
            t->fault = 1;
        }
        input = smaller(larger(t->input_min, input), t->input_max);
    }
    float speed = magnitude(input - t->last_input);
    t->last_input = input;
    float left = input - t->alpha * speed, right = input + t->beta * speed;
#if PREFIX
    int end = 0;
    if (right < t->outputs[0]) {
        while (end < PLAYS && right < t->outputs[end]) t->outputs[end++] = right;
    } else {
        for (; end < PLAYS; end++) {
            float pushed = left - t->thresholds[end];
            if (pushed < t->outputs[end]) break;
            t->outputs[end] = pushed;
        }
    }
    for (int i = end - 1; i >= 0; i--) t->sums[i] = t->sums[i + 2] + t->weights[i] * t->outputs[i];
    float sum = t->sums[0] + t->sums[1];
#else
    for (int i = 0; i < PLAYS; i++) t->outputs[i] = larger(left - t->thresholds[i], smaller(right, t->outputs[i]));
    float this = PLAYS % 2 ? 0 : t->offset, next = PLAYS % 2 ? t->offset : 0;
    for (int i = PLAYS - 1; i >= 0; i--) {
        float with = next + t->weights[i] * t->outputs[i];
        next = this;
        this = with;
    }
    float sum = this + next;
#endif
    float feedforward = (t->cubic * input * input + t->linear) * input + sum;

    /* the feedback */
    float error = reference - measured;
    float wanted = t->integral + t->integral_a_sample * error;
    float command = feedforward + (t->proportional * error + wanted);

    /* the limiter, and the integral as far as that allows */
    if (command >= t->output_min && command <= t->output_max && magnitude(command - t->last_command) <= t->usual_change) {
        t->integral = wanted;
        t->last_command = t->asked = command;
    } else {
        if (!finite(command)) {
            wanted = t->integral;
            command = feedforward + wanted;
        }
        float lowest = larger(t->output_min, t->last_command - t->largest_change);
        float highest = smaller(t->output_max, t->last_command + t->largest_change);
        float allowed = command > highest ? highest : command >= lowest ? command : lowest;
        float excess = allowed - command;
        if (excess < 0 && wanted > t->integral) {
            t->integral = larger(wanted + excess, t->integral);
        } else if (excess > 0 && wanted < t->integral) {
            t->integral = smaller(wanted + excess, t->integral);
        } else {
            t->integral = wanted;
        }
        t->asked = command;
        t->last_command = command = allowed;
    }

    float code = (command - t->dac_min) * t->codes_per_v + 0.5f;
    return code <= 0 ? 0 : code >= 65535 ? 65535 : (uint16_t)code;
}
