/* The same free simulation of MRPI, N = 10, as crates/core/benches/free_simulation.rs, for comparison. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#define N 10

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static void simulate(const double *v, double *y, long n, const double *r, const double *q, double b1, double b2,
                     double alpha, double beta, double rate_hz) {
    double w[N] = {0}, last = 0;
    for (long k = 0; k < n; k++) {
        double speed = fabs((v[k] - last) * rate_hz), left = v[k] - alpha * speed, right = v[k] + beta * speed;
        last = v[k];
        double sum = (b1 * v[k] * v[k] + b2) * v[k];
        for (int i = 0; i < N; i++) {
            double upper = right < w[i] ? right : w[i], lower = left - r[i];
            w[i] = lower > upper ? lower : upper;
            sum += q[i] * w[i];
        }
        y[k] = sum;
    }
}

int main(int argc, char **argv) {
    long n = 1000000;
    int runs = argc > 1 ? atoi(argv[1]) : 20;
    double *v = malloc(n * sizeof *v), *y = malloc(n * sizeof *y), r[N], q[N], best = 1e9;
    for (int i = 0; i < N; i++) r[i] = 0.1 * i, q[i] = 0.1 / (i + 1);
    for (long k = 0; k < n; k++) v[k] = 0.5 - 0.5 * cos(2 * M_PI * 97.0 * k / 50e3);
    for (int run = 0; run < runs; run++) {
        double start = now();
        simulate(v, y, n, r, q, -0.08, 0.5, 3e-4, 1e-4, 50e3);
        double took = now() - start;
        if (took < best) best = took;
    }
    printf("%.4f %.17g\n", best / n * 1e9, y[n - 1]);
    return 0;
}
