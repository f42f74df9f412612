/* A library with the Bladed interface that behaves as the first word of its input file says. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define SWAP(n) avrSWAP[(n) - 1] /* records are numbered from 1 */

static char mode[32] = "law";
static float integral;
static int calls;

void DISCON(float *avrSWAP, int *aviFAIL, const char *accINFILE, char *avcOUTNAME, char *avcMSG)
{
    int status = (int)SWAP(1);
    int late = SWAP(2) > 0.95f;
    if (status == 0) {
        FILE *file = accINFILE[0] ? fopen(accINFILE, "r") : NULL;
        calls = 0;
        if (file) {
            if (fscanf(file, "%31s", mode) != 1)
                strcpy(mode, "law");
            fclose(file);
        }
        integral = SWAP(4);
    }
    calls++;
    if (status < 0) {
        printf("%d calls, last at %.1f s\n", calls, SWAP(2));
        if (!strcmp(mode, "bad_end")) {
            *aviFAIL = -3;
            strcpy(avcMSG, "cannot close");
        }
        return;
    }
    /* integral control of the generator speed from the first pitch angle on */
    integral += 1e-3f * SWAP(3) * (SWAP(20) - SWAP(19)) * (status == 1);
    SWAP(55) = SWAP(56) = 0; /* as they are anyway */
    SWAP(47) = SWAP(22);
    SWAP(45) = integral;
    for (int blade = 0; blade < 3; blade++)
        SWAP(42 + blade) = integral + 0.001f * blade;
    if (!strcmp(mode, "ratio")) { /* of two readings, in steps of a hundredth */
        SWAP(47) = 43093.55f;
        for (int place = 42; place <= 45; place++)
            SWAP(place) = 0.0026f * roundf(100 * SWAP(20) / SWAP(19));
    }
    if (!strcmp(mode, "scribble"))
        SWAP(21) = SWAP(200) = 7;
    if (!strcmp(mode, "outname") && status == 0)
        printf("%s %zu %d %d\n", avcOUTNAME, strlen(avcOUTNAME), (int)SWAP(51), (int)SWAP(64));
    if (!strcmp(mode, "logs")) {
        SWAP(65) = 2;
        for (int k = 0; k < 300; k++)
            SWAP((int)SWAP(63) + k) = 1e9f;
        memset(avcOUTNAME, 'x', (size_t)SWAP(64) - 1);
        avcOUTNAME[(int)SWAP(64) - 1] = 0;
    }
    if (!strcmp(mode, "talk") && write(1, "chatter\n", 8) < 0)
        exit(4);
    if (!late)
        return;
    if (!strcmp(mode, "crash")) {
        printf("about to crash\n");
        *(volatile int *)8 = 1;
    }
    if (!strcmp(mode, "hang"))
        for (volatile int forever = 1; forever;)
            ;
    if (!strcmp(mode, "exit")) {
        printf("bad input, stopping\n");
        exit(3);
    }
    if (!strcmp(mode, "fail")) {
        *aviFAIL = -7;
        strcpy(avcMSG, "no wind vane");
    }
    if (!strcmp(mode, "warn")) {
        *aviFAIL = 1;
        strcpy(avcMSG, "vane is noisy");
    }
    if (!strcmp(mode, "nan"))
        SWAP(45) = NAN;
    if (!strcmp(mode, "yaw"))
        SWAP(48) = 0.01f;
    if (!strcmp(mode, "yaw_torque"))
        SWAP(102) = 4;
    if (!strcmp(mode, "brake"))
        SWAP(36) = 1;
    if (!strcmp(mode, "override"))
        SWAP(55) = 1;
    if (!strcmp(mode, "contactor"))
        SWAP(35) = 2;
    if (!strcmp(mode, "generator_off"))
        SWAP(35) = 0;
    if (!strcmp(mode, "many_logs"))
        SWAP(65) = 301;
    if (!strcmp(mode, "random"))
        SWAP(45) += 1e-6f * (float)(clock() % 1000);
}
