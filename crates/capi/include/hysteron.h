/* Made by cbindgen from crates/capi/src/lib.rs; do not edit. */

#ifndef HYSTERON_H
#define HYSTERON_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// A law with its state. Two threads must not use one at a time.
typedef struct HysteronLaw HysteronLaw;

// What a law takes in at every sample. What the controller has no use for may be anything, 0 for instance.
typedef struct HysteronInput {
  // Reference, micrometres, `hysteron_samples_ahead` samples before it is due.
  float reference_um;
  // Reading of the sensor, micrometres.
  float measured_um;
  // Command of the other axis, volts, as early as the reference.
  float voltage2_v;
  // Motion of the other axis, micrometres, as early as the reference.
  float motion2_um;
  // Temperature of the stage, degrees Celsius.
  float temperature_c;
} HysteronInput;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Loads a `controller.toml`, or a table with a complete law. The law rests at 0 V and 0 degrees Celsius.
//
// Gives NULL where the file is none or cannot be read; `message` then has the reason, cut to `size` bytes with its closing zero.
// `message` may be NULL. What is loaded is freed by `hysteron_free`.
//
// # Safety
// `path` points to a string that ends in zero, in UTF-8. `message` is NULL or has room for `size` bytes.
struct HysteronLaw *hysteron_load(const char *path,
                                  char *message,
                                  size_t size);

// Frees a law. NULL is let be.
//
// # Safety
// `law` is NULL or comes from `hysteron_load`, and is not used afterwards.
void hysteron_free(struct HysteronLaw *law);

// Brings a law back to rest at 0 V, at a temperature of the stage. NULL is let be.
//
// # Safety
// `law` is NULL or comes from `hysteron_load`.
void hysteron_reset(struct HysteronLaw *law, float temperature_c);

// Takes in a sample, and gives the command, volts at the actuator. It is finite, whatever comes in; of NULL it is 0.
//
// # Safety
// `law` is NULL or comes from `hysteron_load`; `input` is NULL or points to an input.
float hysteron_step(struct HysteronLaw *law,
                    const struct HysteronInput *input);

// The reference that is due now, micrometres: what the position is compared with. Of NULL it is 0.
//
// # Safety
// `law` is NULL or comes from `hysteron_load`.
float hysteron_due_um(const struct HysteronLaw *law);

// Whether the last command met a limit.
//
// # Safety
// `law` is NULL or comes from `hysteron_load`.
bool hysteron_limited(const struct HysteronLaw *law);

// Samples that the reference comes before it is due. Of NULL it is 0.
//
// # Safety
// `law` is NULL or comes from `hysteron_load`.
size_t hysteron_samples_ahead(const struct HysteronLaw *law);

// Sample rate that `hysteron_step` is to be called at, hertz. Of NULL it is 0.
//
// # Safety
// `law` is NULL or comes from `hysteron_load`.
double hysteron_sample_rate_hz(const struct HysteronLaw *law);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* HYSTERON_H */
