/* A polynomial without constant within half a width of a middle, a straight line beyond. */
static double straight(const double *powers, int n, double middle, double half, double x) {
    double inside = smaller(larger(middle - half, x), middle + half);
    double value = 0.0, slope = 0.0;
    int i;
    for (i = n - 1; i >= 0; i--) {
        slope = slope * inside + (i + 1) * powers[i];
        value = (value + powers[i]) * inside;
    }
    return value + slope * (x - inside);
}
