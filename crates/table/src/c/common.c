static float larger(float a, float b) { return a > b ? a : b; }

static float smaller(float a, float b) { return a < b ? a : b; }

static int finite_number(float x) { return fabsf(x) <= FLT_MAX; }

/* The input of the inverse: held where it is no number, brought into the range. */
static float admit_input(@name@_state *s, float input) {
    if (!(input >= INPUT_MIN && input <= INPUT_MAX)) {
        input = smaller(larger(INPUT_MIN, finite_number(input) ? input : s->input), INPUT_MAX);
    }
    s->input = input;
    return input;
}

/* Range and slew. */
static float limit(@name@_state *s, float command) {
    float lowest = larger(COMMAND_MIN_V, s->last_v - LARGEST_CHANGE_V);
    float highest = smaller(COMMAND_MAX_V, s->last_v + LARGEST_CHANGE_V);
    s->asked_v = command;
    if (finite_number(command)) {
        s->last_v = command > highest ? highest : command >= lowest ? command : lowest;
    }
    return s->last_v;
}

static float start_v(float volts) { return smaller(larger(COMMAND_MIN_V, volts), COMMAND_MAX_V); }

//{ integral
/* The integral goes no further than to where it meets the limit. */
static void take(@name@_state *s, float to, float excess) {
    float from = s->integral;
    float allowed = to + excess;
    if (excess < 0.0f && to > from) {
        s->integral = larger(allowed, from);
    } else if (excess > 0.0f && to < from) {
        s->integral = smaller(allowed, from);
    } else {
        s->integral = to;
    }
}

//} integral
