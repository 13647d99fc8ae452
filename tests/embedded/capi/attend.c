/* Learned attention from a header that the program wrote: reads 3 poses of sources and that of the target as bits, prints
   the weights' bits. */

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "attention.h"

int main(void) {
    float poses[4][16], weights[3];
    for (int pose = 0; pose < 4; pose++) {
        for (int at = 0; at < 16; at++) {
            uint32_t bits;
            if (scanf("%" SCNx32, &bits) != 1) {
                return 2;
            }
            memcpy(&poses[pose][at], &bits, sizeof bits);
        }
    }
    if (viewfuse_attend_8(viewfuse_attention_parameters, poses[0], 3, poses[3], weights) != VIEWFUSE_STATUS_OK) {
        return 1;
    }
    for (int view = 0; view < 3; view++) {
        uint32_t bits;
        memcpy(&bits, &weights[view], sizeof bits);
        printf("%08" PRIx32 "\n", bits);
    }
    return 0;
}
