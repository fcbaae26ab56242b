/* A mode of the structure, exact for straight lines between samples: its free motion over one, twice its damping, samples a radian. */
static double swung(@name@_mode *mode, const double c[6], double input) {
    double rate = (input - mode->input) * c[5];
    double behind = c[4] * rate;
    double off = mode->position - mode->input + behind, off_rate = mode->rate - rate;
    mode->position = c[0] * off + c[1] * off_rate + input - behind;
    mode->rate = c[2] * off + c[3] * off_rate + rate;
    mode->input = input;
    return mode->position;
}
