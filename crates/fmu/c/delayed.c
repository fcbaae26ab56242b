static double aged(const double *ring, int length, int newest, int age) {
    return ring[age <= newest ? newest - age : newest + length - age];
}

/* Both second differences where they agree in sign, neither more than four times the other; else zeros. */
static void agree(double *a, double *b) {
    double first = *a, second = *b;
    if (first > 0.0 && second > 0.0) {
        *a = first < 4.0 * second ? first : 4.0 * second;
        *b = second < 4.0 * first ? second : 4.0 * first;
    } else if (first < 0.0 && second < 0.0) {
        *a = first > 4.0 * second ? first : 4.0 * second;
        *b = second > 4.0 * first ? second : 4.0 * first;
    } else {
        *a = 0.0;
        *b = 0.0;
    }
}

/* A command so many whole samples and a share of one ago: the cubic through the four around it, straight where they bend to both sides. */
static double delayed(const double *ring, int length, int newest, int whole, double p) {
    double younger = aged(ring, length, newest, whole);
    double older = aged(ring, length, newest, whole + 1);
    double oldest = aged(ring, length, newest, whole + 2);
    double a, b = younger - older - older + oldest;
    if (whole > 0) {
        a = aged(ring, length, newest, whole - 1) - younger - younger + older;
        agree(&a, &b);
    } else {
        double before = older - oldest - oldest + aged(ring, length, newest, whole + 3);
        agree(&b, &before);
        a = b;
    }
    return (1.0 - p) * younger + p * older - p * (1.0 - p) * (1.0 / 6.0) * ((2.0 - p) * a + (1.0 + p) * b);
}
