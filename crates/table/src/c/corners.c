/* Hysteresis by the corners of its input: a sample moves the first plays, all to one bound, or to one bound less their thresholds. */

//{ cubics
/* The sum over the first plays where all are at v, on the left side at v less their thresholds. */
static float sum_at(int plays, int left, float v) {
    const float *c = left ? LEFT_SUMS[plays - 1] : RIGHT_SUMS[plays - 1];
    return left ? ((c[3] * v + c[2]) * v + c[1]) * v + c[0] : ((c[2] * v + c[1]) * v + c[0]) * v;
}

//} cubics
//{ linears
/* The sum over the first plays where all are at v, on the left side at v less their thresholds. */
static float sum_at(int plays, int left, float v) {
    float sum = v * SUMS[plays - 1][0];
    return left ? sum - SUMS[plays - 1][1] : sum;
}

//} linears
/* Whether a bound of a side moves a play that stands at a corner. */
static int touched(const @name@_corner *corner, int left, float threshold, float bound) {
    if (left) {
        return corner->left ? bound >= corner->value : bound - threshold >= corner->value;
    }
    return corner->left ? bound < corner->value - threshold : bound < corner->value;
}

/* Up to which play of a corner a bound moves them, from `from` on. */
static int reach(const @name@_corner *corner, int left, int from, float bound) {
    int end = corner->end;
    if (touched(corner, left, THRESHOLDS[end - 1], bound)) {
        return end;
    }
    if (corner->left == left) {
        return from;
    }
    while (from < end) {
        int middle = from + (end - from) / 2;
        if (touched(corner, left, THRESHOLDS[middle], bound)) {
            from = middle + 1;
        } else {
            end = middle;
        }
    }
    return from;
}

/* Moves the first plays to a bound; the very first is known to move. */
static void sweep(@name@_state *s, int left, float bound) {
    int depth = s->depth;
    int end = s->top.end;
    @name@_corner corner;
    if (s->top.left != left) {
        if (end > 1 && depth + 1 < PLAYS) {
            depth += 1;
            s->below[depth] = s->top;
        }
        end = 1;
    }
    for (;;) {
        corner = s->below[depth];
        if (end < corner.end) {
            end = reach(&corner, left, end, bound);
            if (end < corner.end) {
                break;
            }
        }
        if (depth == 0) {
            break;
        }
        depth -= 1;
    }
    s->offset = 0.0f;
    if (end >= PLAYS) {
        s->limit = left ? FLT_MAX : -FLT_MAX;
    } else if (left && !corner.left) {
        s->offset = THRESHOLDS[end];
        s->limit = corner.value;
    } else if (!left && corner.left) {
        s->limit = corner.value - THRESHOLDS[end];
    } else {
        s->limit = corner.value;
    }
    s->sum_below = corner.sum - sum_at(end, corner.left, corner.value);
    s->depth = (uint16_t)depth;
    s->top.value = bound;
    s->top.left = (uint8_t)left;
    s->top.sum = s->sum_below + sum_at(end, left, bound);
    s->top.end = (uint16_t)end;
}

/* Moves the plays to a sample's bounds; their sum. */
static float sum_of_plays(@name@_state *s, float left_bound, float right_bound) {
    int left = s->top.left;
    float bound = left ? left_bound : right_bound;
    if (touched(&s->top, left, THRESHOLDS[0], bound)) {
        float from_offset = bound - s->offset;
        if (left ? from_offset >= s->limit : from_offset < s->limit) {
            sweep(s, left, bound);
        } else {
            s->top.value = bound;
            s->top.sum = s->sum_below + sum_at(s->top.end, left, bound);
        }
    } else {
        bound = left ? right_bound : left_bound;
        if (touched(&s->top, !left, THRESHOLDS[0], bound)) {
            sweep(s, !left, bound);
        }
    }
    return s->top.sum;
}

/* All plays at one output. */
static void rest_plays(@name@_state *s, float output, float input) {
    int i;
    @name@_corner none = {0.0f, 0.0f, PLAYS, 0};
    float value = finite_number(output) ? output : 0.0f;
    for (i = 0; i < PLAYS; i++) {
        s->below[i] = none;
    }
    s->top = none;
    s->top.value = value;
    s->top.sum = sum_at(PLAYS, 0, value);
    s->depth = 0;
    s->sum_below = 0.0f;
    s->offset = 0.0f;
    s->limit = -FLT_MAX;
    s->input = smaller(larger(INPUT_MIN, finite_number(input) ? input : 0.0f), INPUT_MAX);
}

