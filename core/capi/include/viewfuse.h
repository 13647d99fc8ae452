/*
 * viewfuse for C: how much each source view counts for a target view, and what is made of the views with these weights.
 *
 * No function allocates, keeps a pointer, has state or can panic. Each that can fail returns a viewfuse_status: unless it
 * is VIEWFUSE_STATUS_OK, nothing was written. The same input gives the same bits on every processor.
 *
 * Poses are row-major 4x4 camera-to-world matrices in OpenCV axes (x right, y down, z forward), 16 floats each; the last
 * row is 0 0 0 1. Lengths are in the world's units, whatever these are. Arrays are given by their shape with the slowest
 * index first. Floats must be aligned as the processor wants them. Unless a function says otherwise its output may lie
 * anywhere, also over its input.
 *
 * Generated from core/capi/src: do not edit.
 */

#ifndef VIEWFUSE_H
#define VIEWFUSE_H

#include <stdint.h>

/*
 How many parameters the attention's embedding has.
 */
#define VIEWFUSE_ATTENTION_PARAMETERS 15232

/*
 The result of a call.
 */
enum viewfuse_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   Done.
   */
  VIEWFUSE_STATUS_OK = 0,
  /*
   A pointer is null or not aligned.
   */
  VIEWFUSE_STATUS_POINTER = 1,
  /*
   A count is 0, larger than the function takes, or larger than the memory.
   */
  VIEWFUSE_STATUS_COUNT = 2,
  /*
   The scheme's formula or choice is not one of those listed.
   */
  VIEWFUSE_STATUS_FORMULA = 3,
  /*
   The scheme's parameter is out of its range.
   */
  VIEWFUSE_STATUS_PARAMETER = 4,
  /*
   An entry of a pose is NaN or infinite.
   */
  VIEWFUSE_STATUS_POSE_NOT_FINITE = 5,
  /*
   A coordinate of a camera's place is beyond 1e30.
   */
  VIEWFUSE_STATUS_POSE_TOO_FAR = 6,
  /*
   The last row of a pose is not 0 0 0 1.
   */
  VIEWFUSE_STATUS_POSE_LAST_ROW = 7,
  /*
   The upper left 3x3 block of a pose is scaled or skewed: an entry of R^T R is more than 1e-3 off the identity's.
   */
  VIEWFUSE_STATUS_POSE_NOT_RIGID = 8,
  /*
   The 3x3 block of a pose has the determinant -1: an axis is mirrored.
   */
  VIEWFUSE_STATUS_POSE_MIRRORED = 9,
  /*
   A weight is negative, NaN or infinite.
   */
  VIEWFUSE_STATUS_WEIGHT = 10,
  /*
   A noise level is negative, NaN or infinite, or the levels of a schedule are out of range or in the wrong order.
   */
  VIEWFUSE_STATUS_NOISE_LEVEL = 11,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum viewfuse_status viewfuse_status;
#else
typedef int32_t viewfuse_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 The formulas of camera weighting. Weights are proportional to `1 / (e + 1e-6)`, except for the Gaussian.
 */
enum viewfuse_formula
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   All weights are equal. Choice and parameter are not used.
   */
  VIEWFUSE_FORMULA_MEAN = 0,
  /*
   `exp(-parameter d^2)` with `d` the distance of the centres; the parameter is finite and at least 0.
   */
  VIEWFUSE_FORMULA_GAUSSIAN = 1,
  /*
   `e = d^choice`; the choice is 1, 2 or 3, the parameter is not used.
   */
  VIEWFUSE_FORMULA_DISTANCE = 2,
  /*
   `e = parameter angle / pi + (1 - parameter) d / max d`; the parameter lies in 0 to 1, the choice is a
   viewfuse_angle. With the parameter 1 and the angle between principal axes the best of the formulas.
   */
  VIEWFUSE_FORMULA_ERROR = 3,
  /*
   `e` is the sum of the absolute differences of the two matrices. Choice and parameter are not used.
   */
  VIEWFUSE_FORMULA_L1 = 4,
  /*
   `e` is the Frobenius norm of the difference of the two matrices. Choice and parameter are not used.
   */
  VIEWFUSE_FORMULA_FROBENIUS = 5,
  /*
   `e` is the Frobenius norm of the relative pose. Choice and parameter are not used.
   */
  VIEWFUSE_FORMULA_RELATIVE_FROBENIUS = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum viewfuse_formula viewfuse_formula;
#else
typedef uint32_t viewfuse_formula;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 The angle between two cameras that error weighting uses.
 */
enum viewfuse_angle
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   Between the principal axes.
   */
  VIEWFUSE_ANGLE_PRINCIPAL_AXIS = 0,
  /*
   Of the full relative rotation, roll included.
   */
  VIEWFUSE_ANGLE_FULL_ROTATION = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum viewfuse_angle viewfuse_angle;
#else
typedef uint32_t viewfuse_angle;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 A weighting scheme.
 */
typedef struct {
  /*
   A viewfuse_formula.
   */
  uint32_t formula;
  /*
   What the formula says.
   */
  uint32_t choice;
  /*
   What the formula says.
   */
  float parameter;
} viewfuse_scheme;

/*
 The state of compositing along a ray. Initialised by viewfuse_ray_start.
 */
typedef struct {
  /*
   Weighted sums of red, green and blue so far.
   */
  float accumulated[3];
  /*
   Weighted sum of the depths so far.
   */
  float weighted_depth;
  /*
   Sum of the optical depths.
   */
  float optical_depth;
  /*
   Transmittance of the samples so far, from 0 to 1. Early termination: stop where it is below a threshold. The
   samples behind change a colour by at most this fraction of its range.
   */
  float transmittance;
} viewfuse_ray;

/*
 The composited pixel of a ray.
 */
typedef struct {
  /*
   Red, green, blue, composited over the background.
   */
  float rgb[3];
  /*
   Mean depth of what was hit.
   */
  float depth;
  /*
   Opacity: 1 minus the transmittance, from 0 to 1.
   */
  float opacity;
} viewfuse_pixel;

/*
 The factors around the network at a noise level, for data with the standard deviation 0.5.
 */
typedef struct {
  /*
   Factor of the noisy picture in the denoised one (the skip connection).
   */
  float skip;
  /*
   Factor of the network's output.
   */
  float output;
  /*
   Factor of the network's input.
   */
  float input;
  /*
   The network's noise conditioning: a quarter of the level's natural logarithm.
   */
  float noise;
} viewfuse_preconditioning;

/*
 The factors of a step between noise levels.
 */
typedef struct {
  /*
   What remains of the noise: the level reached divided by the level before.
   */
  float remaining;
  /*
   Factor of the second-order correction; 0 without a correction, as in the step to level 0.
   */
  float correction;
} viewfuse_step;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 The message of a status, in English, as a static string. Every number is valid input.
 */
const char *viewfuse_status_text(int32_t status);

/*
 The weights of up to 8 sources for a target, by formula: finite, at least 0, with the sum 1.

 `source_poses` is `[source_count][4][4]`, `target_pose` is `[4][4]`, `weights` is `[source_count]`.

 # Safety
 Pointers are null or valid for these shapes.
 */
viewfuse_status viewfuse_weigh_8(const viewfuse_scheme *scheme,
                                 const float *source_poses,
                                 uint32_t source_count,
                                 const float *target_pose,
                                 float *weights);

/*
 As viewfuse_weigh_8, for up to 16 sources.

 # Safety
 As viewfuse_weigh_8.
 */
viewfuse_status viewfuse_weigh_16(const viewfuse_scheme *scheme,
                                  const float *source_poses,
                                  uint32_t source_count,
                                  const float *target_pose,
                                  float *weights);

/*
 As viewfuse_weigh_8, for up to 32 sources.

 # Safety
 As viewfuse_weigh_8.
 */
viewfuse_status viewfuse_weigh_32(const viewfuse_scheme *scheme,
                                  const float *source_poses,
                                  uint32_t source_count,
                                  const float *target_pose,
                                  float *weights);

/*
 The weights of up to 8 sources for a target, by learned attention: finite, at least 0, with the sum 1.

 `parameters` is `[VIEWFUSE_ATTENTION_PARAMETERS]`: of each of the three layers (42 to 64, 64 to 64, 64 to 128) the
 weights `[output][input]`, then the biases `[output]`. They are read in place, for example from flash.
 `source_poses` is `[source_count][4][4]`, `target_pose` is `[4][4]`, `weights` is `[source_count]`.

 # Safety
 Pointers are null or valid for these shapes; the parameters do not change during the call.
 */
viewfuse_status viewfuse_attend_8(const float *parameters,
                                  const float *source_poses,
                                  uint32_t source_count,
                                  const float *target_pose,
                                  float *weights);

/*
 As viewfuse_attend_8, for up to 16 sources.

 # Safety
 As viewfuse_attend_8.
 */
viewfuse_status viewfuse_attend_16(const float *parameters,
                                   const float *source_poses,
                                   uint32_t source_count,
                                   const float *target_pose,
                                   float *weights);

/*
 As viewfuse_attend_8, for up to 32 sources.

 # Safety
 As viewfuse_attend_8.
 */
viewfuse_status viewfuse_attend_32(const float *parameters,
                                   const float *source_poses,
                                   uint32_t source_count,
                                   const float *target_pose,
                                   float *weights);

/*
 The weighted sum of the views' latents, in view order.

 `weights` is `[view_count]`, each finite and at least 0; `latents` is `[view_count][channel_count]`, `fused` is
 `[channel_count]`. Latents that are not finite give channels that are not. `fused` may be the same memory as the
 first view's latents, but may not overlap the weights or the latents otherwise.

 # Safety
 Pointers are null or valid for these shapes.
 */
viewfuse_status viewfuse_fuse_views(const float *weights,
                                    const float *latents,
                                    uint32_t view_count,
                                    uint32_t channel_count,
                                    float *fused);

/*
 Starts a ray: no samples yet, transmittance 1.

 # Safety
 The pointer is null or valid.
 */
viewfuse_status viewfuse_ray_start(viewfuse_ray *ray);

/*
 Adds the next sample, front to back: its colour `[3]`, its optical depth (density times length; negative or NaN
 counts as 0, infinity as opaque) and its distance along the ray.

 # Safety
 Pointers are null or valid.
 */
viewfuse_status viewfuse_ray_add(viewfuse_ray *ray, const float *rgb, float optical_depth, float depth);

/*
 Adds the next sample of a solid with a soft boundary, front to back: its colour `[3]`, its occupancy from 0 to 1
 (NaN counts as 0), which is a lower bound of the ray's opacity, and its distance along the ray. For one ray use
 either this or viewfuse_ray_add.

 # Safety
 Pointers are null or valid.
 */
viewfuse_status viewfuse_ray_add_solid(viewfuse_ray *ray, const float *rgb, float occupancy, float depth);

/*
 The pixel, with the background `[3]` behind everything; `empty_depth` is the depth of a ray that hit nothing. The
 ray is not changed.

 # Safety
 Pointers are null or valid.
 */
viewfuse_status viewfuse_ray_finish(const viewfuse_ray *ray,
                                    const float *background,
                                    float empty_depth,
                                    viewfuse_pixel *pixel);

/*
 Noise level `index` of `count` from `sigma_max` (the first) down to `sigma_min` (the last), evenly spaced in the
 seventh root; level `count` and everything behind is 0. The published schedule runs from 80 to 0.002. Both levels
 lie between 1e-30 and 1e30.

 # Safety
 The pointer is null or valid.
 */
viewfuse_status viewfuse_noise_level(float sigma_min, float sigma_max, uint32_t index, uint32_t count, float *level);

/*
 The factors at a noise level of at least 0. At 0 the network's output counts nothing; `noise` is then that of the
 level 1.2e-38 instead of minus infinity.

 # Safety
 The pointer is null or valid.
 */
viewfuse_status viewfuse_preconditioning_at(float sigma, viewfuse_preconditioning *factors);

/*
 The factors of the step from level `sigma` to level `next`, both at least 0.

 # Safety
 The pointer is null or valid.
 */
viewfuse_status viewfuse_step_between(float sigma, float next, viewfuse_step *step);

/*
 The network's input: `input * noisy`, for `count` values.

 `noisy` and `given` are `[count]`; they may be the same array, but may not overlap otherwise.

 # Safety
 Pointers are null or valid for these shapes.
 */
viewfuse_status viewfuse_network_input(const viewfuse_preconditioning *factors,
                                       const float *noisy,
                                       uint32_t count,
                                       float *given);

/*
 The denoised picture from the noisy one and the network's output: `skip * noisy + output * network_output`, for
 `count` values.

 All arrays are `[count]`; `denoised` may be one of the others, but may not overlap them otherwise.

 # Safety
 Pointers are null or valid for these shapes.
 */
viewfuse_status viewfuse_denoised(const viewfuse_preconditioning *factors,
                                  const float *noisy,
                                  const float *network_output,
                                  uint32_t count,
                                  float *denoised);

/*
 The first-order step of a picture: from the noisy one and the denoised one at the level before to the level reached.
 The step to level 0 gives the denoised picture.

 All arrays are `[count]`; `stepped` may be one of the others, but may not overlap them otherwise. Keep the denoised
 picture for the correction.

 # Safety
 Pointers are null or valid for these shapes.
 */
viewfuse_status viewfuse_step_euler(const viewfuse_step *step,
                                    const float *noisy,
                                    const float *denoised,
                                    uint32_t count,
                                    float *stepped);

/*
 The second-order step of a picture: from the first-order one, the denoised picture that led to it, and the denoised
 picture there.

 All arrays are `[count]`; `corrected` may be one of the others, but may not overlap them otherwise.

 # Safety
 Pointers are null or valid for these shapes.
 */
viewfuse_status viewfuse_step_correct(const viewfuse_step *step,
                                      const float *stepped,
                                      const float *denoised,
                                      const float *denoised_there,
                                      uint32_t count,
                                      float *corrected);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* VIEWFUSE_H */
