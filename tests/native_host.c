/* A host without Python for an FMI 2.0 component linked into it: does what a file says, prints hexadecimal numbers. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "model.h"

static void tell(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...)
{
    (void)e;
    fprintf(stderr, "%s: %s: %d: %s\n", name, category, (int)status, text);
}

int main(int argc, char **argv)
{
    fmi2CallbackFunctions functions = {tell, NULL, NULL, NULL, NULL};
    FILE *file = argc == 2 ? fopen(argv[1], "r") : NULL;
    fmi2Component c = fmi2Instantiate("host", fmi2CoSimulation, MODEL_TOKEN, "", &functions, fmi2False, fmi2True);
    char word[16], first[64], second[64];
    int status = file && c ? 0 : 1;
    while (status == 0 && fscanf(file, "%15s %63s %63s", word, first, second) == 3) {
        fmi2ValueReference reference = (fmi2ValueReference)strtoul(first, NULL, 10);
        fmi2Real real = strtod(second, NULL);
        fmi2Integer integer = (fmi2Integer)real;
        if (strcmp(word, "enter") == 0) {
            status = fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) || fmi2EnterInitializationMode(c);
        } else if (strcmp(word, "leave") == 0) {
            status = fmi2ExitInitializationMode(c);
        } else if (strcmp(word, "real") == 0) {
            status = fmi2SetReal(c, &reference, 1, &real);
        } else if (strcmp(word, "boolean") == 0) {
            status = fmi2SetBoolean(c, &reference, 1, &integer);
        } else if (strcmp(word, "step") == 0) {
            status = fmi2DoStep(c, strtod(first, NULL), real, fmi2True);
        } else if (strcmp(word, "show") == 0) {
            status = fmi2GetReal(c, &reference, 1, &real);
            printf("%a\n", real);
        } else {
            status = fmi2SetInteger(c, &reference, 1, &integer);
        }
    }
    fmi2FreeInstance(c);
    return status;
}
