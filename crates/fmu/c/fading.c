/* What an element of a length of the path holds: exact where what it follows goes straight from one value to another. */
static double faded(double held, double from, double to, double lengths) {
    double lags = (to - from) / lengths;
    return to - lags + (held - from + lags) * exp(-lengths);
}
