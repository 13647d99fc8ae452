/* Calls everything in viewfuse.h on numbers from the standard input and prints what comes out, all as bits. */

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "viewfuse.h"

#define SOURCES 32
#define CHANNELS 16
#define SAMPLES 64
#define VALUES 48

static float parameters[VIEWFUSE_ATTENTION_PARAMETERS];
static float sources[SOURCES][16];
static float target[16];
static float latents[SOURCES][CHANNELS];
static float samples[SAMPLES][5];
static float background[3];
static float noisy[VALUES];
static float outputs[2][VALUES];

static void read_floats(float *numbers, size_t count) {
    for (size_t index = 0; index < count; index++) {
        uint32_t bits;
        if (scanf("%" SCNx32, &bits) != 1) {
            fprintf(stderr, "the input ends too early\n");
            exit(2);
        }
        memcpy(&numbers[index], &bits, sizeof bits);
    }
}

static void print_floats(const char *name, const float *numbers, size_t count) {
    printf("%s", name);
    for (size_t index = 0; index < count; index++) {
        uint32_t bits;
        memcpy(&bits, &numbers[index], sizeof bits);
        printf(" %08" PRIx32, bits);
    }
    printf("\n");
}

static void done(viewfuse_status status) {
    if (status != VIEWFUSE_STATUS_OK) {
        fprintf(stderr, "%s\n", viewfuse_status_text(status));
        exit(3);
    }
}

typedef viewfuse_status weighing(const viewfuse_scheme *, const float *, uint32_t, const float *, float *);
typedef viewfuse_status attending(const float *, const float *, uint32_t, const float *, float *);

static void weigh_and_fuse(void) {
    static const viewfuse_scheme schemes[] = {
        {VIEWFUSE_FORMULA_MEAN, 7, -1.0f},
        {VIEWFUSE_FORMULA_GAUSSIAN, 7, 0.75f},
        {VIEWFUSE_FORMULA_DISTANCE, 1, -1.0f},
        {VIEWFUSE_FORMULA_DISTANCE, 2, -1.0f},
        {VIEWFUSE_FORMULA_DISTANCE, 3, -1.0f},
        {VIEWFUSE_FORMULA_ERROR, VIEWFUSE_ANGLE_PRINCIPAL_AXIS, 1.0f},
        {VIEWFUSE_FORMULA_ERROR, VIEWFUSE_ANGLE_PRINCIPAL_AXIS, 0.25f},
        {VIEWFUSE_FORMULA_ERROR, VIEWFUSE_ANGLE_FULL_ROTATION, 0.5f},
        {VIEWFUSE_FORMULA_L1, 7, -1.0f},
        {VIEWFUSE_FORMULA_FROBENIUS, 7, -1.0f},
        {VIEWFUSE_FORMULA_RELATIVE_FROBENIUS, 7, -1.0f},
    };
    static weighing *const weigh[] = {viewfuse_weigh_8, viewfuse_weigh_16, viewfuse_weigh_32};
    static attending *const attend[] = {viewfuse_attend_8, viewfuse_attend_16, viewfuse_attend_32};
    static const uint32_t counts[][3] = {{1, 3, 8}, {2, 9, 16}, {5, 17, 32}};
    float weights[SOURCES];
    float fused[CHANNELS];
    for (size_t size = 0; size < 3; size++) {
        for (size_t which = 0; which < 3; which++) {
            const uint32_t count = counts[size][which];
            for (size_t scheme = 0; scheme < sizeof schemes / sizeof schemes[0]; scheme++) {
                done(weigh[size](&schemes[scheme], sources[0], count, target, weights));
                print_floats("weigh", weights, count);
            }
            done(attend[size](parameters, sources[0], count, target, weights));
            print_floats("attend", weights, count);
            done(viewfuse_fuse_views(weights, latents[0], count, CHANNELS, fused));
            print_floats("fuse", fused, CHANNELS);
        }
    }
    /* In place: weights over the poses that they come from, the result over the first view's latents. */
    done(viewfuse_weigh_32(&schemes[5], sources[0], SOURCES, target, sources[0]));
    print_floats("weigh", sources[0], SOURCES);
    done(viewfuse_fuse_views(sources[0], latents[0], SOURCES, CHANNELS, latents[0]));
    print_floats("fuse", latents[0], CHANNELS);
}

static void composite(void) {
    for (int solid = 0; solid < 2; solid++) {
        viewfuse_ray ray;
        viewfuse_pixel pixel;
        done(viewfuse_ray_start(&ray));
        for (size_t sample = 0; sample < SAMPLES; sample++) {
            const float *rgb = samples[sample];
            done(solid ? viewfuse_ray_add_solid(&ray, rgb, rgb[3], rgb[4]) : viewfuse_ray_add(&ray, rgb, rgb[3], rgb[4]));
            print_floats("ray", &ray.transmittance, 1);
        }
        done(viewfuse_ray_finish(&ray, background, 9.0f, &pixel));
        print_floats("rgb", pixel.rgb, 3);
        print_floats("depth", &pixel.depth, 1);
        print_floats("opacity", &pixel.opacity, 1);
    }
}

/* Steps with two given outputs of a network in place of one that looks at the picture. */
static void denoise(void) {
    static const uint32_t counts[] = {1, 2, 5, 25};
    for (size_t which = 0; which < sizeof counts / sizeof counts[0]; which++) {
        float picture[VALUES], input[VALUES], denoised[VALUES], there[VALUES];
        memcpy(picture, noisy, sizeof picture);
        for (uint32_t index = 0; index < counts[which]; index++) {
            float levels[2];
            viewfuse_preconditioning factors;
            viewfuse_step step;
            done(viewfuse_noise_level(0.002f, 80.0f, index, counts[which], &levels[0]));
            done(viewfuse_noise_level(0.002f, 80.0f, index + 1, counts[which], &levels[1]));
            print_floats("levels", levels, 2);
            done(viewfuse_preconditioning_at(levels[0], &factors));
            print_floats("noise", &factors.noise, 1);
            done(viewfuse_network_input(&factors, picture, VALUES, input));
            print_floats("input", input, VALUES);
            done(viewfuse_denoised(&factors, picture, outputs[0], VALUES, denoised));
            done(viewfuse_step_between(levels[0], levels[1], &step));
            done(viewfuse_step_euler(&step, picture, denoised, VALUES, picture));
            if (step.correction > 0.0f) {
                done(viewfuse_preconditioning_at(levels[1], &factors));
                done(viewfuse_denoised(&factors, picture, outputs[1], VALUES, there));
                done(viewfuse_step_correct(&step, picture, denoised, there, VALUES, picture));
            }
            print_floats("picture", picture, VALUES);
        }
    }
}

int main(void) {
    read_floats(parameters, VIEWFUSE_ATTENTION_PARAMETERS);
    read_floats(sources[0], SOURCES * 16);
    read_floats(target, 16);
    read_floats(latents[0], SOURCES * CHANNELS);
    read_floats(samples[0], SAMPLES * 5);
    read_floats(background, 3);
    read_floats(noisy, VALUES);
    read_floats(outputs[0], 2 * VALUES);
    weigh_and_fuse();
    composite();
    denoise();
    return 0;
}
