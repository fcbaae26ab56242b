/* A first-order lag, exact for straight lines between samples. */
static double lagged(@name@_lag *lag, double approach, double through, double input) {
    lag->output += approach * (lag->input - lag->output) + through * (input - lag->input);
    lag->input = input;
    return lag->output;
}
