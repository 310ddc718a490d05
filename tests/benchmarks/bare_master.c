/* What the compiled loop is measured against: three native FMUs of FMI 2.0, stepped and wired by hand, seven outputs
   recorded. Made for the FMUs of test_orchestrator_ratio.py, which writes calls.h. */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "fmi2Functions.h"
#include "calls.h"

static void say(fmi2ComponentEnvironment e, fmi2String name, fmi2Status s, fmi2String c, fmi2String text, ...)
{
    fprintf(stderr, "%s: %s\n", name, text);
}

typedef struct {
    fmi2Component instance;
    fmi2SetRealTYPE *set_real;
    fmi2SetIntegerTYPE *set_integer;
    fmi2GetRealTYPE *get_real;
    fmi2GetIntegerTYPE *get_integer;
    fmi2DoStepTYPE *step;
    void *library;
} Fmu;

static void check(int status)
{
    if (status > fmi2Warning)
        exit(1);
}

static fmi2CallbackFunctions callbacks = {say, calloc, free, NULL, NULL};

static Fmu open_fmu(const char *path, const char *name, const char *guid)
{
    Fmu f = {0};
    f.library = dlopen(path, RTLD_NOW);
    if (!f.library)
        exit(2);
    fmi2InstantiateTYPE *make = (fmi2InstantiateTYPE *)dlsym(f.library, "fmi2Instantiate");
    f.instance = make(name, fmi2CoSimulation, guid, NULL, &callbacks, fmi2False, fmi2False);
    f.set_real = (fmi2SetRealTYPE *)dlsym(f.library, "fmi2SetReal");
    f.set_integer = (fmi2SetIntegerTYPE *)dlsym(f.library, "fmi2SetInteger");
    f.get_real = (fmi2GetRealTYPE *)dlsym(f.library, "fmi2GetReal");
    f.get_integer = (fmi2GetIntegerTYPE *)dlsym(f.library, "fmi2GetInteger");
    f.step = (fmi2DoStepTYPE *)dlsym(f.library, "fmi2DoStep");
    if (!f.instance)
        exit(3);
    check(((fmi2SetupExperimentTYPE *)dlsym(f.library, "fmi2SetupExperiment"))(f.instance, 0, 0.0, 0.0, 1, STOP));
    return f;
}

static void initialise(Fmu *f, const char *call)
{
    check(((fmi2EnterInitializationModeTYPE *)dlsym(f->library, call))(f->instance));
}

int main(int count, char **words)
{
    long steps = atol(words[1]);
    Fmu table = open_fmu(TABLE_LIBRARY, "table", TABLE_GUID), block = open_fmu(BLOCK_LIBRARY, "block", BLOCK_GUID);
    Fmu computer = open_fmu(COMPUTER_LIBRARY, "computer", COMPUTER_GUID);
    double moved[6], read[3], attitude[4], *rows = malloc((steps + 1) * 7 * sizeof(double));
    memset(rows, 0, (steps + 1) * 7 * sizeof(double));
    Fmu *all[3] = {&table, &block, &computer};
    const char *calls[2] = {"fmi2EnterInitializationMode", "fmi2ExitInitializationMode"};
    check(table.set_real(table.instance, COMMAND, 2, command));
    for (int c = 0; c < 2; c++) {
        for (int i = 0; i < 3; i++)
            initialise(all[i], calls[c]);
        check(table.get_real(table.instance, MOVED, 6, moved));
        check(block.set_real(block.instance, FORCE, 3, moved));
        check(computer.set_real(computer.instance, INCREMENT, 3, moved + 3));
    }
    check(block.get_real(block.instance, READING, 3, rows));
    check(computer.get_real(computer.instance, ATTITUDE, 4, rows + 3));
    struct timespec began, ended;
    clock_gettime(CLOCK_MONOTONIC, &began);
    for (long k = 0; k < steps; k++) {
        double t = k * STEP, *row = rows + 7 * (k + 1);
        check(table.step(table.instance, t, STEP, fmi2True));
        check(table.get_real(table.instance, MOVED, 6, moved));
        check(block.set_real(block.instance, FORCE, 3, moved));
        check(block.step(block.instance, t, STEP, fmi2True));
        check(block.get_real(block.instance, READING, 3, read));
        check(computer.set_real(computer.instance, INCREMENT, 3, moved + 3));
        check(computer.step(computer.instance, t, STEP, fmi2True));
        check(computer.get_real(computer.instance, ATTITUDE, 4, attitude));
        memcpy(row, read, sizeof read);
        memcpy(row + 3, attitude, sizeof attitude);
    }
    clock_gettime(CLOCK_MONOTONIC, &ended);
    printf("%.9f", (ended.tv_sec - began.tv_sec) + 1e-9 * (ended.tv_nsec - began.tv_nsec));
    for (int i = 0; i < 7; i++)
        printf(" %a", rows[7 * steps + i]);
    return 0;
}
