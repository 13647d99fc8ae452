/* Every way to call viewfuse.h wrongly has its status, and nothing is written then. */

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "viewfuse.h"

#define UNTOUCHED 123.0f

static int failures;
static int seen[12];

static float results[64];
static float words[64];
static viewfuse_ray ray;
static viewfuse_pixel pixel;
static viewfuse_preconditioning factors;
static viewfuse_step step;

static void mark(void) {
    for (size_t index = 0; index < 64; index++) {
        results[index] = UNTOUCHED;
    }
    memset(&pixel, 0x42, sizeof pixel);
}

#define EXPECT(expected, call) expect(VIEWFUSE_STATUS_##expected, (call), #call, __LINE__)

static void expect(viewfuse_status expected, viewfuse_status actual, const char *call, int line) {
    unsigned char untouched[sizeof pixel];
    int is_touched = 0;
    memset(untouched, 0x42, sizeof untouched);
    for (size_t index = 0; index < 64; index++) {
        is_touched |= results[index] < UNTOUCHED || results[index] > UNTOUCHED;
    }
    is_touched |= memcmp(&pixel, untouched, sizeof pixel) != 0;
    if (actual != expected || (is_touched && expected != VIEWFUSE_STATUS_OK)) {
        printf("line %d: %s: %s%s\n", line, call, viewfuse_status_text(actual), is_touched ? ", and it wrote" : "");
        failures++;
    }
    seen[expected] = 1;
    mark();
}

static const float identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

/* The identity with one entry changed. */
static const float *changed(size_t entry, float value) {
    static float pose[16];
    memcpy(pose, identity, sizeof pose);
    pose[entry] = value;
    return pose;
}

static const float *misaligned(const float *numbers) { return (const float *)(const void *)((const char *)numbers + 1); }

static float *misaligned_result(void) { return (float *)(void *)((char *)results + 2); }

static viewfuse_status weigh(uint32_t formula, uint32_t choice, float parameter) {
    const viewfuse_scheme scheme = {formula, choice, parameter};
    return viewfuse_weigh_8(&scheme, identity, 1, identity, results);
}

static void schemes(void) {
    EXPECT(FORMULA, weigh(UINT32_MAX, 0, 0.0f));
    EXPECT(FORMULA, weigh(VIEWFUSE_FORMULA_DISTANCE, 0, 0.0f));
    EXPECT(FORMULA, weigh(VIEWFUSE_FORMULA_DISTANCE, 4, 0.0f));
    EXPECT(FORMULA, weigh(VIEWFUSE_FORMULA_ERROR, 2, 0.0f));
    EXPECT(PARAMETER, weigh(VIEWFUSE_FORMULA_ERROR, 0, -0.1f));
    EXPECT(PARAMETER, weigh(VIEWFUSE_FORMULA_ERROR, 1, 1.1f));
    EXPECT(PARAMETER, weigh(VIEWFUSE_FORMULA_ERROR, 0, NAN));
    EXPECT(PARAMETER, weigh(VIEWFUSE_FORMULA_GAUSSIAN, 0, -1.0f));
    EXPECT(PARAMETER, weigh(VIEWFUSE_FORMULA_GAUSSIAN, 0, INFINITY));
    EXPECT(OK, weigh(VIEWFUSE_FORMULA_GAUSSIAN, 0, 0.0f));
}

static void cameras(void) {
    static float parameters[VIEWFUSE_ATTENTION_PARAMETERS];
    static float poses[33][16];
    const viewfuse_scheme mean = {VIEWFUSE_FORMULA_MEAN, 0, 0.0f};
    const viewfuse_scheme *scheme = &mean;
    const float mirrored[16] = {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    for (size_t view = 0; view < 33; view++) {
        memcpy(poses[view], identity, sizeof identity);
    }
    EXPECT(POINTER, viewfuse_weigh_8(NULL, identity, 1, identity, results));
    EXPECT(POINTER, viewfuse_weigh_8((const viewfuse_scheme *)(const void *)((const char *)words + 1), identity, 1,
                                     identity, results));
    EXPECT(POINTER, viewfuse_weigh_8(scheme, NULL, 1, identity, results));
    EXPECT(POINTER, viewfuse_weigh_8(scheme, misaligned(words), 1, identity, results));
    EXPECT(POINTER, viewfuse_weigh_8(scheme, identity, 1, NULL, results));
    EXPECT(POINTER, viewfuse_weigh_8(scheme, identity, 1, misaligned(words), results));
    EXPECT(POINTER, viewfuse_weigh_8(scheme, identity, 1, identity, NULL));
    EXPECT(POINTER, viewfuse_weigh_8(scheme, identity, 1, identity, misaligned_result()));
    EXPECT(POINTER, viewfuse_attend_8(NULL, identity, 1, identity, results));
    EXPECT(POINTER, viewfuse_attend_8(misaligned(parameters), identity, 1, identity, results));
    EXPECT(POINTER, viewfuse_attend_8(parameters, NULL, 1, identity, results));
    EXPECT(POINTER, viewfuse_attend_8(parameters, identity, 1, NULL, results));
    EXPECT(POINTER, viewfuse_attend_8(parameters, identity, 1, identity, NULL));
    EXPECT(COUNT, viewfuse_weigh_8(scheme, poses[0], 0, identity, results));
    EXPECT(COUNT, viewfuse_weigh_8(scheme, poses[0], 9, identity, results));
    EXPECT(COUNT, viewfuse_weigh_16(scheme, poses[0], 17, identity, results));
    EXPECT(COUNT, viewfuse_weigh_32(scheme, poses[0], 33, identity, results));
    EXPECT(COUNT, viewfuse_weigh_32(scheme, poses[0], UINT32_MAX, identity, results));
    EXPECT(COUNT, viewfuse_attend_8(parameters, poses[0], 0, identity, results));
    EXPECT(COUNT, viewfuse_attend_8(parameters, poses[0], 9, identity, results));
    EXPECT(COUNT, viewfuse_attend_16(parameters, poses[0], 17, identity, results));
    EXPECT(COUNT, viewfuse_attend_32(parameters, poses[0], 33, identity, results));
    EXPECT(OK, viewfuse_weigh_32(scheme, poses[0], 32, identity, results));
    for (size_t entry = 0; entry < 16; entry++) {
        EXPECT(POSE_NOT_FINITE, viewfuse_weigh_8(scheme, changed(entry, NAN), 1, identity, results));
        EXPECT(POSE_NOT_FINITE, viewfuse_weigh_8(scheme, identity, 1, changed(entry, -INFINITY), results));
        EXPECT(POSE_NOT_FINITE, viewfuse_attend_8(parameters, identity, 1, changed(entry, NAN), results));
    }
    EXPECT(POSE_TOO_FAR, viewfuse_weigh_8(scheme, changed(7, 1.1e30f), 1, identity, results));
    EXPECT(POSE_LAST_ROW, viewfuse_weigh_8(scheme, identity, 1, changed(13, 0.5f), results));
    EXPECT(POSE_LAST_ROW, viewfuse_weigh_8(scheme, identity, 1, changed(15, 0.0f), results));
    EXPECT(POSE_NOT_RIGID, viewfuse_weigh_8(scheme, changed(0, 1.01f), 1, identity, results));
    EXPECT(POSE_NOT_RIGID, viewfuse_attend_8(parameters, changed(1, 0.1f), 1, identity, results));
    EXPECT(POSE_MIRRORED, viewfuse_weigh_8(scheme, mirrored, 1, identity, results));
    /* The last of several. */
    poses[7][0] = 2.0f;
    EXPECT(OK, viewfuse_weigh_8(scheme, poses[0], 7, identity, results));
    EXPECT(POSE_NOT_RIGID, viewfuse_weigh_8(scheme, poses[0], 8, identity, results));
}

static viewfuse_status fuse(float weight) {
    const float weights[2] = {0.5f, weight};
    return viewfuse_fuse_views(weights, words, 2, 4, results);
}

static void latents(void) {
    EXPECT(POINTER, viewfuse_fuse_views(NULL, words, 1, 1, results));
    EXPECT(POINTER, viewfuse_fuse_views(words, NULL, 1, 1, results));
    EXPECT(POINTER, viewfuse_fuse_views(words, misaligned(words), 1, 1, results));
    EXPECT(POINTER, viewfuse_fuse_views(words, words, 1, 1, NULL));
    EXPECT(COUNT, viewfuse_fuse_views(words, words, 0, 1, results));
    EXPECT(COUNT, viewfuse_fuse_views(words, words, 1, 0, results));
    EXPECT(COUNT, viewfuse_fuse_views(words, words, UINT32_MAX, UINT32_MAX, results));
    EXPECT(WEIGHT, fuse(-0.1f));
    EXPECT(WEIGHT, fuse(NAN));
    EXPECT(WEIGHT, fuse(INFINITY));
    EXPECT(OK, fuse(0.0f));
}

static void rays(void) {
    EXPECT(POINTER, viewfuse_ray_start(NULL));
    EXPECT(OK, viewfuse_ray_start(&ray));
    EXPECT(POINTER, viewfuse_ray_add(NULL, words, 1.0f, 1.0f));
    EXPECT(POINTER, viewfuse_ray_add(&ray, NULL, 1.0f, 1.0f));
    EXPECT(POINTER, viewfuse_ray_add_solid(NULL, words, 1.0f, 1.0f));
    EXPECT(POINTER, viewfuse_ray_add_solid(&ray, misaligned(words), 1.0f, 1.0f));
    EXPECT(POINTER, viewfuse_ray_finish(NULL, words, 1.0f, &pixel));
    EXPECT(POINTER, viewfuse_ray_finish(&ray, NULL, 1.0f, &pixel));
    EXPECT(POINTER, viewfuse_ray_finish(&ray, words, 1.0f, NULL));
    if (ray.transmittance < 1.0f) {
        printf("a refused sample changed the ray\n");
        failures++;
    }
}

static void noise(void) {
    EXPECT(POINTER, viewfuse_noise_level(0.002f, 80.0f, 0, 4, NULL));
    EXPECT(COUNT, viewfuse_noise_level(0.002f, 80.0f, 0, 0, results));
    EXPECT(NOISE_LEVEL, viewfuse_noise_level(0.0f, 80.0f, 0, 4, results));
    EXPECT(NOISE_LEVEL, viewfuse_noise_level(0.002f, INFINITY, 0, 4, results));
    EXPECT(NOISE_LEVEL, viewfuse_noise_level(80.0f, 0.002f, 0, 4, results));
    EXPECT(POINTER, viewfuse_preconditioning_at(1.0f, NULL));
    EXPECT(NOISE_LEVEL, viewfuse_preconditioning_at(-1.0f, &factors));
    EXPECT(NOISE_LEVEL, viewfuse_preconditioning_at(NAN, &factors));
    EXPECT(OK, viewfuse_preconditioning_at(0.0f, &factors));
    EXPECT(POINTER, viewfuse_step_between(1.0f, 0.5f, NULL));
    EXPECT(NOISE_LEVEL, viewfuse_step_between(INFINITY, 0.5f, &step));
    EXPECT(NOISE_LEVEL, viewfuse_step_between(1.0f, -0.5f, &step));
    EXPECT(OK, viewfuse_step_between(1.0f, 0.0f, &step));
    EXPECT(POINTER, viewfuse_network_input(NULL, words, 4, results));
    EXPECT(POINTER, viewfuse_network_input(&factors, NULL, 4, results));
    EXPECT(POINTER, viewfuse_network_input(&factors, words, 4, NULL));
    EXPECT(COUNT, viewfuse_network_input(&factors, words, 0, results));
    EXPECT(POINTER, viewfuse_denoised(NULL, words, words, 4, results));
    EXPECT(POINTER, viewfuse_denoised(&factors, NULL, words, 4, results));
    EXPECT(POINTER, viewfuse_denoised(&factors, words, misaligned(words), 4, results));
    EXPECT(POINTER, viewfuse_denoised(&factors, words, words, 4, misaligned_result()));
    EXPECT(COUNT, viewfuse_denoised(&factors, words, words, 0, results));
    EXPECT(POINTER, viewfuse_step_euler(NULL, words, words, 4, results));
    EXPECT(POINTER, viewfuse_step_euler(&step, NULL, words, 4, results));
    EXPECT(POINTER, viewfuse_step_euler(&step, words, NULL, 4, results));
    EXPECT(POINTER, viewfuse_step_euler(&step, words, words, 4, NULL));
    EXPECT(COUNT, viewfuse_step_euler(&step, words, words, 0, results));
    EXPECT(POINTER, viewfuse_step_correct(NULL, words, words, words, 4, results));
    EXPECT(POINTER, viewfuse_step_correct(&step, NULL, words, words, 4, results));
    EXPECT(POINTER, viewfuse_step_correct(&step, words, NULL, words, 4, results));
    EXPECT(POINTER, viewfuse_step_correct(&step, words, words, NULL, 4, results));
    EXPECT(POINTER, viewfuse_step_correct(&step, words, words, words, 4, NULL));
    EXPECT(COUNT, viewfuse_step_correct(&step, words, words, words, 0, results));
}

int main(void) {
    mark();
    schemes();
    cameras();
    latents();
    rays();
    noise();
    for (int status = 0; status < 12; status++) {
        const char *text = viewfuse_status_text(status);
        if (!seen[status] || strlen(text) < 4 || strcmp(text, viewfuse_status_text(12)) == 0) {
            printf("status %d was not seen or has no text\n", status);
            failures++;
        }
    }
    return failures == 0 ? 0 : 1;
}
