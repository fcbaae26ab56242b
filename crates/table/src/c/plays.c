/* Moves the plays to a sample's bounds: those that move are the first ones, all on one side. */
static void move_plays(@name@_state *s, float left, float right) {
    int i;
    for (i = 0; i < PLAYS && right < s->plays[i]; i++) {
        s->plays[i] = right;
    }
    if (i > 0) {
        return;
    }
    for (i = 0; i < PLAYS && left - THRESHOLDS[i] >= s->plays[i]; i++) {
        s->plays[i] = left - THRESHOLDS[i];
    }
}

/* All plays at one output. */
static void rest_plays(@name@_state *s, float output, float input) {
    int i;
    float value = finite_number(output) ? output : 0.0f;
    for (i = 0; i < PLAYS; i++) {
        s->plays[i] = value;
    }
    s->input = smaller(larger(INPUT_MIN, finite_number(input) ? input : 0.0f), INPUT_MAX);
}

//{ dot
/* Weights times plays, even and odd ones apart. */
static float weighted(const float *weights, const float *plays) {
    int i;
    float sums[2] = {0.0f, 0.0f};
    for (i = 0; i < PLAYS; i++) {
        float term = weights[i] * plays[i];
        sums[i & 1] = PLAYS > 1 && i < 2 ? term : sums[i & 1] + term;
    }
    return sums[0] + sums[1];
}

//} dot
