/* FMI 3.0: co-simulation, and what it shares with model exchange. */
#include "fmi3Functions.h"

#include "component.h"

#define CALL(phases)                                                                                                   \
    Component *c = instance;                                                                                           \
    if (!may(c, __func__, phases)) {                                                                                   \
        return fmi3Error;                                                                                              \
    }

/* FMI 3.0 wants silence where logging is off. */
void emit(const Listener *to, int status, const char *category, const char *text)
{
    if (to->logger && to->logging) {
        ((fmi3LogMessageCallback)to->logger)(to->environment, (fmi3Status)status, category, text);
    }
}

const char* fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories, const fmi3String
    categories[])
{
    CALL(ANY_PHASE)
    return set_logging(c, __func__, loggingOn, nCategories, categories);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken, fmi3String
    resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage)
{
    Listener listener = {instanceName, instanceEnvironment, (void (*)(void))logMessage, loggingOn, 0};
    (void)resourcePath;
    (void)visible;
    return create(instantiationToken, &listener, 1);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken, fmi3String
    resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed, fmi3Boolean
    earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[], size_t
    nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
    fmi3IntermediateUpdateCallback intermediateUpdate)
{
    (void)resourcePath;
    (void)visible;
    (void)earlyReturnAllowed;
    (void)requiredIntermediateVariables;
    (void)nRequiredIntermediateVariables;
    (void)intermediateUpdate;
    Listener listener = {instanceName, instanceEnvironment, (void (*)(void))logMessage, loggingOn, 0};
    Component *c = create(instantiationToken, &listener, 0);
    if (c && eventModeUsed) {
        refuse(c, "%s: the FMU has no event mode", __func__);
        destroy(c);
        return NULL;
    }
    return c;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken, fmi3String
    resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate, fmi3LockPreemptionCallback lockPreemption,
    fmi3UnlockPreemptionCallback unlockPreemption)
{
    Listener listener = {instanceName, instanceEnvironment, (void (*)(void))logMessage, loggingOn, 0};
    (void)instantiationToken;
    (void)resourcePath;
    (void)visible;
    (void)clockUpdate;
    (void)lockPreemption;
    (void)unlockPreemption;
    say(&listener, "%s: this FMU has no scheduled execution", __func__);
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    destroy(instance);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
    fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    CALL(IN(INSTANTIATED))
    (void)toleranceDefined;
    (void)tolerance;
    if (begin(c, __func__, startTime, stopTimeDefined, stopTime) != OK) {
        return fmi3Error;
    }
    c->state.phase = INITIALISING;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    CALL(IN(INITIALISING))
    return finish_initialisation(c, __func__);
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    CALL(RUNNING | IN(FAILED))
    c->state.phase = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    CALL(ANY_PHASE)
    reset(c);
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Float64 values[], size_t nValues)
{
    CALL(INITIALISED)
    return get_reals(c, __func__, valueReferences, nValueReferences, values, nValues);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Float64 values[], size_t nValues)
{
    CALL(SETTABLE)
    return set_reals(c, __func__, valueReferences, nValueReferences, values, nValues);
}

fmi3Status fmi3GetInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Int32 values[], size_t nValues)
{
    CALL(INITIALISED)
    return get_values(c, __func__, INTEGER, INTS, valueReferences, nValueReferences, values, nValues);
}

fmi3Status fmi3SetInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Int32 values[], size_t nValues)
{
    CALL(SETTABLE)
    return set_values(c, __func__, INTEGER, INTS, valueReferences, nValueReferences, values, nValues);
}

fmi3Status fmi3GetInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Int64 values[], size_t nValues)
{
    CALL(INITIALISED)
    return get_values(c, __func__, ENUMERATION, INT64S, valueReferences, nValueReferences, values, nValues);
}

fmi3Status fmi3SetInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Int64 values[], size_t nValues)
{
    CALL(SETTABLE)
    return set_values(c, __func__, ENUMERATION, INT64S, valueReferences, nValueReferences, values, nValues);
}

fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Boolean values[], size_t nValues)
{
    CALL(INITIALISED)
    return get_values(c, __func__, BOOLEAN, BOOLS, valueReferences, nValueReferences, values, nValues);
}

fmi3Status fmi3SetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Boolean values[], size_t nValues)
{
    CALL(SETTABLE)
    return set_values(c, __func__, BOOLEAN, BOOLS, valueReferences, nValueReferences, values, nValues);
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    CALL(ANY_PHASE)
    return save(c, __func__, FMUState);
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState)
{
    CALL(ANY_PHASE)
    return restore(c, __func__, FMUState);
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    CALL(ANY_PHASE)
    return discard(c, __func__, FMUState);
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    CALL(ANY_PHASE)
    return serialised_size(c, __func__, FMUState, size);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[], size_t
    size)
{
    CALL(ANY_PHASE)
    return serialise(c, __func__, FMUState, serializedState, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[], size_t size, fmi3FMUState
    *FMUState)
{
    CALL(ANY_PHASE)
    return deserialise(c, __func__, serializedState, size, FMUState);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64
    sensitivity[], size_t nSensitivity)
{
    CALL(INITIALISED)
    return differentiate(c, __func__, unknowns, nUnknowns, knowns, nKnowns, seed, nSeed, sensitivity, nSensitivity);
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
    fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
    fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    CALL(IN(STEPPING))
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!eventHandlingNeeded || !terminateSimulation || !earlyReturn || !lastSuccessfulTime) {
        return refuse(c, "%s: there is no place for what it returns", __func__);
    }
    *eventHandlingNeeded = fmi3False;
    *terminateSimulation = fmi3False;
    *earlyReturn = fmi3False;
    *lastSuccessfulTime = c->state.time;
    int status = do_step(c, __func__, currentCommunicationPoint, communicationStepSize);
    *lastSuccessfulTime = c->state.time;
    return status;
}
