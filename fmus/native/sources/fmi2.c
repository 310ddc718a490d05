/* FMI 2.0: co-simulation, and what it shares with model exchange. */
#include "fmi2Functions.h"

#include "component.h"

#define CALL(phases)                                                                                                   \
    Component *c = instance;                                                                                           \
    if (!may(c, __func__, phases)) {                                                                                   \
        return fmi2Error;                                                                                              \
    }

/* Refusals are told whether or not debugging is on. */
void emit(const Listener *to, int status, const char *category, const char *text)
{
    if (to->logger && (to->logging || status >= ERROR)) {
        ((fmi2CallbackLogger)to->logger)(to->environment, to->name ? to->name : "", (fmi2Status)status, category, text);
    }
}

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component instance, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[])
{
    CALL(ANY_PHASE)
    return set_logging(c, __func__, loggingOn, nCategories, categories);
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn)
{
    (void)fmuResourceLocation;
    (void)visible;
    if (!functions) {
        return NULL;
    }
    Listener listener = {instanceName, functions->componentEnvironment, (void (*)(void))functions->logger, loggingOn, 0};
    return create(fmuGUID, &listener, fmuType != fmi2CoSimulation);
}

void fmi2FreeInstance(fmi2Component instance)
{
    destroy(instance);
}

fmi2Status fmi2SetupExperiment(fmi2Component instance, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    CALL(IN(INSTANTIATED))
    (void)toleranceDefined;
    (void)tolerance;
    return begin(c, __func__, startTime, stopTimeDefined, stopTime);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component instance)
{
    CALL(IN(INSTANTIATED))
    if (!finite_number(c->state.time)) {
        return refuse(c, "%s: fmi2SetupExperiment has to come first: there is no start time", __func__);
    }
    c->state.phase = INITIALISING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component instance)
{
    CALL(IN(INITIALISING))
    return finish_initialisation(c, __func__);
}

fmi2Status fmi2Terminate(fmi2Component instance)
{
    CALL(RUNNING | IN(FAILED))
    c->state.phase = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component instance)
{
    CALL(ANY_PHASE)
    reset(c);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    CALL(INITIALISED)
    return get_reals(c, __func__, vr, nvr, value, nvr);
}

fmi2Status fmi2GetInteger(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    CALL(INITIALISED)
    return get_values(c, __func__, INTEGER, INTS, vr, nvr, value, nvr);
}

fmi2Status fmi2GetBoolean(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    CALL(INITIALISED)
    return get_values(c, __func__, BOOLEAN, INTS, vr, nvr, value, nvr);
}

fmi2Status fmi2SetReal(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    CALL(SETTABLE)
    return set_reals(c, __func__, vr, nvr, value, nvr);
}

fmi2Status fmi2SetInteger(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    CALL(SETTABLE)
    return set_values(c, __func__, INTEGER, INTS, vr, nvr, value, nvr);
}

fmi2Status fmi2SetBoolean(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    CALL(SETTABLE)
    return set_values(c, __func__, BOOLEAN, INTS, vr, nvr, value, nvr);
}

fmi2Status fmi2GetString(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    CALL(INITIALISED)
    (void)vr;
    (void)value;
    return nvr ? refuse(c, "%s: no variable is a string", __func__) : fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    CALL(SETTABLE)
    (void)vr;
    (void)value;
    return nvr ? refuse(c, "%s: no variable is a string", __func__) : fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component instance, fmi2FMUstate *state)
{
    CALL(ANY_PHASE)
    return save(c, __func__, state);
}

fmi2Status fmi2SetFMUstate(fmi2Component instance, fmi2FMUstate state)
{
    CALL(ANY_PHASE)
    return restore(c, __func__, state);
}

fmi2Status fmi2FreeFMUstate(fmi2Component instance, fmi2FMUstate *state)
{
    CALL(ANY_PHASE)
    return discard(c, __func__, state);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component instance, fmi2FMUstate state, size_t *size)
{
    CALL(ANY_PHASE)
    return serialised_size(c, __func__, state, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component instance, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    CALL(ANY_PHASE)
    return serialise(c, __func__, state, bytes, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component instance, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    CALL(ANY_PHASE)
    return deserialise(c, __func__, bytes, size, state);
}

fmi2Status fmi2DoStep(fmi2Component instance, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    CALL(IN(STEPPING))
    (void)noSetFMUStatePriorToCurrentPoint;
    return do_step(c, __func__, currentCommunicationPoint, communicationStepSize);
}

fmi2Status fmi2CancelStep(fmi2Component instance)
{
    CALL(ANY_PHASE)
    return refuse(c, "%s: no step runs: steps are done when fmi2DoStep returns", __func__);
}

fmi2Status fmi2GetStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Status *value)
{
    CALL(ANY_PHASE)
    (void)kind;
    (void)value;
    refuse(c, "%s: no step runs: steps are done when fmi2DoStep returns", __func__);
    return fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Real *value)
{
    CALL(IN(STEPPING) | IN(FAILED) | IN(TERMINATED))
    if (kind != fmi2LastSuccessfulTime || !value) {
        refuse(c, "%s: the last successful time is the only real status", __func__);
        return fmi2Discard;
    }
    *value = c->state.time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Integer *value)
{
    CALL(ANY_PHASE)
    (void)kind;
    (void)value;
    refuse(c, "%s: there is no integer status", __func__);
    return fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Boolean *value)
{
    CALL(IN(STEPPING) | IN(FAILED) | IN(TERMINATED))
    if (kind != fmi2Terminated || !value) {
        refuse(c, "%s: fmi2Terminated is the only boolean status", __func__);
        return fmi2Discard;
    }
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2String *value)
{
    CALL(ANY_PHASE)
    (void)kind;
    (void)value;
    refuse(c, "%s: there is no string status", __func__);
    return fmi2Discard;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component instance, const fmi2ValueReference unknown[], size_t nUnknown,
                                        const fmi2ValueReference known[], size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[])
{
    CALL(INITIALISED)
    return differentiate(c, __func__, unknown, nUnknown, known, nKnown, dvKnown, nKnown, dvUnknown, nUnknown);
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    CALL(ANY_PHASE)
    (void)vr;
    (void)nvr;
    (void)order;
    (void)value;
    return refuse(c, "%s: the FMU does not interpolate inputs", __func__);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    CALL(ANY_PHASE)
    (void)vr;
    (void)nvr;
    (void)order;
    (void)value;
    return refuse(c, "%s: the FMU does not provide them", __func__);
}
