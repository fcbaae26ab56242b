/* The inverse: volts of a position. */
static float inverse(@name@_state *s, float position) {
//{ with_change
    float before = s->input;
//} with_change
    float input = admit_input(s, position);
//{ enveloped
    float speed = fabsf(input - before);
    float left = input - ALPHA * speed;
    float right = input + BETA * speed;
//} enveloped
//{ corners
    float sum = sum_of_plays(s, left, right);
    return OFFSET + ((CUBIC * input * input + LINEAR) * input + sum);
//} corners
//{ mpi
    move_plays(s, input, input);
    return OFFSET + ((CUBIC * input * input + LINEAR) * input + weighted(WEIGHTS, s->plays));
//} mpi
//{ wrpi
    float rate = (input - before) * SAMPLE_RATE_HZ;
    move_plays(s, input, input);
    return OFFSET
        + ((CUBIC * input * input + LINEAR) * input + weighted(WEIGHTS, s->plays)
           + rate * weighted(RATE_WEIGHTS, s->plays));
//} wrpi
//{ mrpi
    float sums[2] = {PLAYS % 2 == 0 ? 0.0f : OFFSET, PLAYS % 2 == 0 ? OFFSET : 0.0f};
    int i;
    move_plays(s, left, right);
    for (i = 0; i < PLAYS; i++) {
        sums[i & 1] += WEIGHTS[PLAYS - 1 - i] * s->plays[PLAYS - 1 - i];
    }
    return (CUBIC * input * input + LINEAR) * input + (sums[0] + sums[1]);
//} mrpi
//{ polynomial
    float sum = 0.0f;
    int i;
    move_plays(s, input, input);
    for (i = 4; i >= 0; i--) {
        sum = (sum + INPUT_FUNCTION[i]) * input;
    }
    for (i = 0; i < PLAYS; i++) {
        float w = s->plays[i];
        sum += ((WEIGHTS_CUBIC[i] * w + WEIGHTS_QUADRATIC[i]) * w + WEIGHTS[i]) * w;
    }
    return OFFSET + sum;
//} polynomial
}

void @name@_reset(@name@_state *state, const @name@_input *now) {
    rest_plays(state, now->measured_um, now->reference_um);
    state->integral = 0.0f;
    state->due_um = now->reference_um;
    state->last_v = start_v(SAFE_V);
    state->asked_v = state->last_v;
    @name@_set_feedback(state, 1.0f);
}

void @name@_set_feedback(@name@_state *state, float share) {
    share = smaller(larger(share, 0.0f), 1.0f);
    state->gains[0] = PROPORTIONAL * share;
    state->gains[1] = INTEGRAL_A_SAMPLE * share;
}

float @name@_step(@name@_state *state, const @name@_input *now) {
    float feedforward = inverse(state, now->reference_um);
    float error = now->reference_um - now->measured_um;
    float integral = state->integral + state->gains[1] * error;
    float command = feedforward + (state->gains[0] * error + integral);
    float allowed;
    state->due_um = now->reference_um;
    if (!finite_number(command)) {
        /* An error that is not finite, or not far from it, counts as none. */
        integral = state->integral + state->gains[1] * 0.0f;
        command = feedforward + (state->gains[0] * 0.0f + integral);
    }
    allowed = limit(state, command);
    take(state, integral, allowed - command);
    return allowed;
}

