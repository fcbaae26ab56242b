/* @name@: a control law made by `hysteron export --format c`. C99, no allocation, no library.
 *
 * Table: @family@, @plays@ plays, SHA-256 @hash@.@covered@
//{ complete
 * The law: the reference ahead, modes, creep, hysteresis, lead; feedback where the table has it.
//} complete
//{ paper
 * The law: the inverse of the hysteresis plus PI.
//} paper
 *
 * Call @name@_step once a sample, @NAME@_SAMPLE_RATE_HZ times a second. It returns a finite command within its limits for every
 * input, NaN included. Compile without -ffast-math, and with -ffp-contract=off for the same bits everywhere.
 */
#ifndef @NAME@_H
#define @NAME@_H

#include <stdint.h>

#define @NAME@_SAMPLE_RATE_HZ @rate@
/* Lowest and highest reference, micrometres. */
#define @NAME@_LOWEST_UM @lowest@
#define @NAME@_HIGHEST_UM @highest@
/* Samples that the reference comes before it is due. */
#define @NAME@_SAMPLES_AHEAD @ahead@
/* Where the command starts and ends, volts, and how fast it should go there from elsewhere. */
#define @NAME@_SAFE_V @safe@
#define @NAME@_RAMP_V_PER_S @ramp@
/* Up to this frequency of the reference feedback helps; from twice it, let none act: @name@_set_feedback. */
#define @NAME@_FEEDBACK_UP_TO_HZ @feedback_up_to@

/* What a sample takes in. */
typedef struct {
    float reference_um; /* @NAME@_SAMPLES_AHEAD samples before it is due */
    float measured_um;  /* the sensor's reading */
//{ coupling
    float voltage2_v;   /* command of the other axis, as many samples ahead */
//} coupling
//{ cross
    float motion2_um;   /* reference of the other axis less its rest, as many samples ahead */
//} cross
//{ heat
    float temperature_c;
//} heat
} @name@_input;

//{ sections
typedef struct {
    float delays[2];
} @name@_section;

//} sections
//{ corners
typedef struct {
    float value, sum;
    uint16_t end;
    uint8_t left;
} @name@_corner;

//} corners
/* What the law remembers, not for reading. */
typedef struct {
    float input;
//{ corners
    @name@_corner top, below[@plays@];
    uint16_t depth;
    float sum_below, offset, limit;
//} corners
//{ plays
    float plays[@plays@];
//} plays
//{ paper
    float gains[2];
//} paper
    float integral, last_v, asked_v, due_um;
//{ complete
    float falls[2 * @taps@], newest_fall_um;
    float ring[@taps@], newest_um;
    uint16_t begin, place;
    @name@_section second_mode;
    float creep_fast[@fast@], creep_slow[@slow@], crept_slowly, moved, mean, next_mean, creep_wanted;
    uint32_t creep_samples;
    float wanted_v;
    uint8_t feedback;
//} complete
//{ feedback
    @name@_section series[2], damping;
//{ trust
    float trust_slow;
//} trust
//} feedback
//{ coupling
    float coupling_last, coupling_play;
//} coupling
//{ hum
    float hum[2 * @harmonics@], hum_predicted;
    uint16_t hum_bounded;
//} hum
//{ adaptation
    float adapt_gain, adapt_zero, adapt_motion, adapt_missed, adapt_correction;
    float adapt_mean_motion, adapt_mean_missed, adapt_square;
    float adapt_lag, adapt_target, adapt_last, adapt_late, adapt_rise, adapt_mean_rise;
    uint32_t adapt_taken;
    uint8_t adapt_spoilt, adapt_begun, adapt_jumped;
//} adaptation
//{ heat
    float heat_output, heat_input;
//} heat
//{ sensor_lag
    float sensor_output, sensor_input;
//} sensor_lag
} @name@_state;

//{ complete
/* The stage was cycled and rests at 0 V@at_temperature@; nothing else of `now` is used. */
//} complete
//{ paper
/* The stage rests where `now` reads it, the command at its safe level; the first reference is that of `now`. */
//} paper
void @name@_reset(@name@_state *state, const @name@_input *now);

/* One sample: the command, volts at the actuator. */
float @name@_step(@name@_state *state, const @name@_input *now);

/* The share of the feedback that acts, 0 to 1@share@. */
void @name@_set_feedback(@name@_state *state, float share);

/* The reference that is due, which the position of the last sample was compared with, micrometres. */
float @name@_due_um(const @name@_state *state);

/* Whether a limit changed the last command. */
int @name@_limited(const @name@_state *state);

/* Code of the table's 16-bit DAC for a command, and position of a code of its ADC. */
uint16_t @name@_dac_code(float volts);
float @name@_adc_um(uint16_t code);

#endif
