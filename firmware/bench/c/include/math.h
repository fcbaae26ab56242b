/* What a generated law asks of the C library, for a compiler that comes without one. */
static inline float fabsf(float x) { return __builtin_fabsf(x); }
