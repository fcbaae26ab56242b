static float admit(float input, float last) { return fabsf(input) <= 1e30f ? input : last; }

/* A second-order section. */
static float section(const float *c, @name@_section *s, float input) {
    float output = c[0] * input + s->delays[0];
    float first = c[1] * input - c[3] * output + s->delays[1];
    float second = c[2] * input - c[4] * output;
    if (!(fabsf(first) <= 1e36f)) {
        s->delays[0] = 0.0f;
        s->delays[1] = 0.0f;
        return 0.0f;
    }
    s->delays[0] = first;
    s->delays[1] = second;
    return output;
}

/* Latency and structure: a filter over the reference ahead, by its steps from sample to sample. */
static float preview(@name@_state *s, float reference_ahead) {
    int j;
    float newest = admit(reference_ahead, s->newest_fall_um);
    float fall = s->newest_fall_um - newest;
    float sum = TOTAL * newest;
    s->newest_fall_um = newest;
    s->begin = (uint16_t)(s->begin > 0 ? s->begin - 1 : TAPS - 1);
    s->falls[s->begin] = fall;
    s->falls[s->begin + TAPS] = fall;
    for (j = 0; j < TAPS - 1; j++) {
        sum += TAILS[j] * s->falls[s->begin + j];
    }
    return sum;
}

/* Creep undone; of the slow elements one moves in a sample. */
static float before_creep(@name@_state *s, float wanted) {
    uint32_t slow = s->creep_samples;
    float crept = s->crept_slowly;
    float before;
    int i;
    wanted = admit(wanted, s->creep_wanted);
    s->creep_wanted = wanted;
    for (i = 0; i < CREEP_FAST; i++) {
        crept += FAST_SHARES[i] * s->creep_fast[i];
    }
    before = (wanted - crept) * AT_ONCE;
    for (i = 0; i < CREEP_FAST; i++) {
        s->creep_fast[i] += FAST_APPROACH[i] * (before - s->creep_fast[i]);
    }
    if (slow < CREEP_SLOW) {
        s->creep_slow[slow] += SLOW_APPROACH[slow] * (s->mean - s->creep_slow[slow]);
        s->moved += SLOW_SHARES[slow] * s->creep_slow[slow];
        if (slow + 1 == CREEP_SLOW) {
            s->crept_slowly = s->moved;
            s->moved = 0.0f;
        }
    }
    s->next_mean += before * SHARE_OF_A_SAMPLE;
    s->creep_samples += 1;
    if (s->creep_samples >= CREEP_DIVIDER) {
        s->mean = s->next_mean;
        s->next_mean = 0.0f;
        s->creep_samples = 0;
    }
    return before;
}

/* Hysteresis undone. */
static float inverse(@name@_state *s, float position) {
    float input = admit_input(s, position);
    float sum = 0.0f;
    int i;
    for (i = 4; i >= 0; i--) {
        sum = (sum + INPUT_FUNCTION[i]) * input;
    }
    return OFFSET + (sum + sum_of_plays(s, input, input));
}

/* The chain backwards: the command for a reference ahead. */
static float feedforward(@name@_state *s, float target) {
    float previewed = preview(s, target);
    float structure = section(SECOND_MODE, &s->second_mode, admit(previewed, 0.0f));
    float wanted = inverse(s, before_creep(s, structure));
    float before = s->wanted_v;
    s->wanted_v = wanted;
    return before + (wanted - before) * (LEAD + LEAD_HALF_CHANGE * (before + wanted));
}

/* Takes in a reference and gives the one that is due. */
static float take_in(@name@_state *s, float reference_ahead) {
    float newest = admit(reference_ahead, s->newest_um);
    s->newest_um = newest;
    s->due_um = newest;
//{ ahead
    s->due_um = s->ring[s->place];
    s->ring[s->place] = newest;
    s->place = (uint16_t)(s->place + 1 < @NAME@_SAMPLES_AHEAD ? s->place + 1 : 0);
//} ahead
    return s->due_um;
}

//{ coupling
/* What the other axis' command moves of this one. */
static float coupling(@name@_state *s, float volts) {
    float input = admit(volts, s->coupling_last);
    float difference = input - s->coupling_last;
    s->coupling_last = input;
    s->coupling_play = larger(input - COUPLING[3], smaller(input, s->coupling_play));
    return COUPLING[0] * input + COUPLING[1] * difference + COUPLING[2] * s->coupling_play;
}

//} coupling
//{ lag
static float lag(const float *shares, float *output, float *last, float input) {
    input = admit(input, *last);
    *output += shares[0] * (*last - *output) + shares[1] * (input - *last);
    *last = input;
    return *output;
}

//} lag
//{ heat
static float kelvin(float temperature_c) { return smaller(larger(-100.0f, temperature_c - HEAT[2]), 100.0f); }

static float undo_heat(@name@_state *s, float wanted, float temperature_c) {
    float warmer = lag(HEAT + 3, &s->heat_output, &s->heat_input, kelvin(temperature_c));
    return (wanted - HEAT[0] * warmer) / larger(1.0f + HEAT[1] * warmer, 0.1f);
}

//} heat
//{ sensor
/* The sensor's curve undone: three steps of Newton's method. */
static float position_of(float reading) {
    float from_middle = reading - SENSOR[0];
    float u = from_middle;
    int i;
    for (i = 0; i < 3; i++) {
        float slope = larger(1.0f + u * (2.0f * SENSOR[1] + u * (3.0f * SENSOR[2])), 0.25f);
        u -= (u * (1.0f + u * (SENSOR[1] + u * SENSOR[2])) - from_middle) / slope;
    }
    return SENSOR[0] + admit(u, from_middle);
}

//} sensor
//{ hum
static float bound(float x) { return smaller(larger(-HUM_LARGEST, x), HUM_LARGEST); }

/* The mains: each harmonic is turned on, and learned from the error. */
static void learn_hum(@name@_state *s, float error) {
    float *part = &s->hum[s->hum_bounded];
    int i;
    error = bound(finite_number(error) ? error : 0.0f);
    *part = bound(*part);
    s->hum_bounded = (uint16_t)(s->hum_bounded > 0 ? s->hum_bounded - 1 : 2 * HARMONICS - 1);
    s->hum_predicted = 0.0f;
    for (i = 0; i < HARMONICS; i++) {
        float left_im = s->hum[2 * i] - error * HUM_RATES[i][0];
        float left_re = s->hum[2 * i + 1] - error * HUM_RATES[i][1];
        s->hum[2 * i] = left_re * HUM_TURNS[i][0] + left_im * HUM_TURNS[i][1];
        s->hum[2 * i + 1] = left_re * HUM_TURNS[i][1] - left_im * HUM_TURNS[i][0];
        s->hum_predicted += s->hum[2 * i + 1];
    }
}

//} hum
//{ adaptation
static float within(float x, float bound) { return larger(smaller(x, bound), -bound); }

/* What the means over a block tell of gain, zero and lag. */
static void end_block(@name@_state *s) {
    float motion = s->adapt_motion * ADAPTATION[4], missed = s->adapt_missed * ADAPTATION[4];
    float late = s->adapt_late * ADAPTATION[4], rise = s->adapt_rise * ADAPTATION[4];
    float swing, missed_swing;
    uint8_t spoilt = s->adapt_spoilt, jumped = s->adapt_jumped;
    s->adapt_motion = 0.0f;
    s->adapt_missed = 0.0f;
    s->adapt_late = 0.0f;
    s->adapt_rise = 0.0f;
    s->adapt_taken = 0;
    s->adapt_spoilt = 0;
    s->adapt_jumped = 0;
    if (spoilt) {
        s->adapt_jumped = 1;
        return;
    }
    if (!s->adapt_begun) {
        s->adapt_begun = 1;
        s->adapt_mean_motion = motion;
        s->adapt_mean_missed = missed;
    }
    swing = motion - s->adapt_mean_motion;
    missed_swing = missed - s->adapt_mean_missed;
    s->adapt_mean_motion += ADAPTATION[5] * swing;
    s->adapt_mean_missed += ADAPTATION[5] * missed_swing;
    s->adapt_square += ADAPTATION[5] * (swing * swing - s->adapt_square);
    if (!jumped) {
        s->adapt_mean_rise += ADAPTATION[5] * (rise - s->adapt_mean_rise);
    }
    if (s->adapt_square > ADAPTATION[6]) {
        float asked = (missed_swing - within(missed_swing, ADAPTATION[2])) * (swing / s->adapt_square);
        float step = within(admit(asked, 0.0f), ADAPTATION[0]);
        s->adapt_gain = within(s->adapt_gain + ADAPTATION[5] * step, ADAPTATION[0]);
    }
    if (!jumped && s->adapt_mean_rise > ADAPTATION[9] && s->adapt_mean_rise > ADAPTATION[10] * s->adapt_square) {
        float step = within(admit(late / s->adapt_mean_rise, 0.0f), ADAPTATION[7]);
        s->adapt_lag = within(s->adapt_lag + ADAPTATION[5] * step, ADAPTATION[7]);
    }
    missed = missed - within(missed, ADAPTATION[2]);
    s->adapt_zero = within(s->adapt_zero + ADAPTATION[5] * missed, ADAPTATION[1]);
}

/* Gain, zero and lag, learned from what the feedforward misses. */
static void learn_adaptation(@name@_state *s, float error, float correction) {
    float motion = s->due_um - REST_UM, missed = error + ADAPTATION[3] * correction;
    if (fabsf(missed) <= 1e6f && fabsf(motion) <= 1e6f && !@name@_limited(s)) {
        float rise = motion - s->adapt_last, swing = missed - s->adapt_mean_missed;
        s->adapt_last = motion;
        s->adapt_jumped |= fabsf(rise) > ADAPTATION[8];
        s->adapt_motion += motion;
        s->adapt_missed += missed;
        s->adapt_late += (swing - within(swing, ADAPTATION[2])) * rise;
        s->adapt_rise += rise * rise;
    } else {
        s->adapt_spoilt = 1;
    }
    s->adapt_taken++;
    if (s->adapt_taken >= ADAPTATION_SAMPLES) {
        end_block(s);
    }
}

/* The target with what was learned. */
static float adapted(@name@_state *s, float target) {
    float rise = target - s->adapt_target;
    float late = fabsf(rise) <= ADAPTATION[8] ? s->adapt_lag * rise : 0.0f;
    s->adapt_target = admit(target, s->adapt_target);
    return target + s->adapt_gain * target + s->adapt_zero + late;
}

//} adaptation
//{ trust
/* What the sensor is trusted with: about a slow part that follows at a rate. */
static float trusted(@name@_state *s, float asked) {
    float slow = s->trust_slow;
    float allowed = larger(slow - TRUST[0], smaller(asked, slow + TRUST[0]));
    float toward = allowed > slow ? TRUST[2] : -TRUST[2];
    s->trust_slow = larger(smaller(slow + toward, TRUST[1]), -TRUST[1]);
    return allowed;
}

//} trust
//{ feedback
/* Integral behind two sections, a damping filter beside it, through the limiter. */
static float close_loop(@name@_state *s, float command, float error) {
    float damping, shaped, integral, asked, bounded, allowed;
    error = admit(error, 0.0f);
    damping = section(DAMPING, &s->damping, error);
    shaped = section(SERIES[0], &s->series[0], error);
    shaped = section(SERIES[1], &s->series[1], shaped);
    shaped = fabsf(shaped) <= 1e25f ? shaped : 0.0f;
    integral = s->integral + INTEGRAL_A_SAMPLE * shaped;
    asked = (PROPORTIONAL * shaped + integral) + damping;
    bounded = asked;
//{ trust
    bounded = trusted(s, asked);
//} trust
    command = command + bounded;
    allowed = limit(s, command);
    take(s, integral, (bounded - asked) + (allowed - command));
//{ adaptation
    s->adapt_correction = bounded;
//} adaptation
    return allowed;
}

//} feedback
void @name@_reset(@name@_state *state, const @name@_input *now) {
    @name@_state fresh = {0};
    int i;
    (void)now;
    *state = fresh;
    for (i = 0; i < TAPS; i++) {
        state->ring[i] = REST_UM;
    }
    state->newest_um = REST_UM;
    state->due_um = REST_UM;
    rest_plays(state, 0.0f, 0.0f);
    state->wanted_v = inverse(state, 0.0f);
    state->last_v = start_v(0.0f);
    state->asked_v = state->last_v;
    state->feedback = 1;
//{ heat
    state->heat_output = admit(kelvin(now->temperature_c), 0.0f);
    state->heat_input = state->heat_output;
//} heat
//{ sensor_lag
    state->sensor_output = admit(REST_UM, 0.0f);
    state->sensor_input = state->sensor_output;
//} sensor_lag
}

void @name@_set_feedback(@name@_state *state, float share) { state->feedback = share > 0.0f; }

float @name@_step(@name@_state *state, const @name@_input *now) {
    float target = now->reference_um - REST_UM;
    float command, expected, position, error;
//{ coupling
    target -= coupling(state, now->voltage2_v);
//} coupling
//{ cross
    target -= CROSS * now->motion2_um;
//} cross
//{ hum
    target -= state->hum_predicted;
//} hum
//{ heat
    target = undo_heat(state, target, now->temperature_c);
//} heat
//{ adaptation
    target = adapted(state, target);
//} adaptation
    command = feedforward(state, target);
    expected = take_in(state, now->reference_um);
//{ sensor_lag
    expected = lag(SENSOR_LAG, &state->sensor_output, &state->sensor_input, expected);
//} sensor_lag
    position = now->measured_um;
//{ sensor
    position = position_of(position);
//} sensor
    error = expected - position;
//{ hum
    learn_hum(state, error);
//} hum
//{ adaptation
    state->adapt_correction = 0.0f;
//} adaptation
//{ feedback
    if (state->feedback) {
        command = close_loop(state, command, error);
    } else {
        command = limit(state, command);
    }
//} feedback
//{ open
    (void)error;
    command = limit(state, command);
//} open
//{ adaptation
    learn_adaptation(state, error, state->adapt_correction);
//} adaptation
    return command;
}

