/* A first-order lag whose time constant, in samples, grows with its output from a level on. */
static double grown_to(double tau, double per_v, double volts) {
    double samples = tau + per_v * volts;
    return samples > 0.0 ? samples : 0.0;
}

static double grown(@name@_lag *lag, double tau, double per_v, double from, double input) {
    double way = 0.5 * (lag->input + input) - lag->output;
    double half_on = lag->output + 0.5 * way / (grown_to(tau, per_v, lag->output - from) + 0.5);
    double samples = grown_to(tau, per_v, half_on - from);
    double approach = samples < 1e-9 ? 1.0 : -expm1(-1.0 / samples);
    double through = samples < 1e-9 ? 1.0 : 1.0 - approach * samples;
    if (samples > 1e3) {
        double x = 1.0 / samples;
        through = x * (0.5 - x * (1.0 / 6.0 - x / 24.0));
    }
    return lagged(lag, approach, through, input);
}
