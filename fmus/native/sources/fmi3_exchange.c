/* FMI 3.0 model exchange. */
#include "fmi3Functions.h"

#include "component.h"

#define EXCHANGING(phases)                                                                                             \
    Component *c = instance;                                                                                           \
    if (!may(c, __func__, phases)) {                                                                                   \
        return fmi3Error;                                                                                              \
    }
#define OF_EXCHANGE(phases)                                                                                            \
    EXCHANGING(phases)                                                                                                 \
    if (!c->exchange) {                                                                                                \
        return refuse(c, "%s: the instance is one for co-simulation", __func__);                                       \
    }

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    EXCHANGING(IN(FLOWING) | IN(EVENTS))
    return change_phase(c, __func__, EVENTS);
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    EXCHANGING(IN(EVENTS))
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate, fmi3Boolean
    *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged, fmi3Boolean
    *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime)
{
    EXCHANGING(IN(EVENTS))
    int defined = 0;
    if (!discreteStatesNeedUpdate || !terminateSimulation || !nominalsOfContinuousStatesChanged ||
        !valuesOfContinuousStatesChanged || !nextEventTimeDefined) {
        return refuse(c, "%s: there is no place for what it returns", __func__);
    }
    *discreteStatesNeedUpdate = fmi3False;
    *terminateSimulation = fmi3False;
    *nominalsOfContinuousStatesChanged = fmi3False;
    *valuesOfContinuousStatesChanged = fmi3False;
    int status = update_events(c, __func__, &defined, nextEventTime);
    *nextEventTimeDefined = defined != 0;
    return status;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    EXCHANGING(IN(EVENTS))
    return change_phase(c, __func__, FLOWING);
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
    fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation)
{
    EXCHANGING(IN(FLOWING))
    (void)noSetFMUStatePriorToCurrentPoint;
    int enter = 0;
    if (!enterEventMode || !terminateSimulation) {
        return refuse(c, "%s: there is no place for what it returns", __func__);
    }
    int status = complete_step(c, __func__, &enter);
    *enterEventMode = enter != 0;
    *terminateSimulation = fmi3False;
    return status;
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    EXCHANGING(IN(FLOWING) | IN(EVENTS))
    return set_time(c, __func__, time);
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[], size_t
    nContinuousStates)
{
    EXCHANGING(IN(FLOWING))
    (void)continuousStates;
    return no_states(c, __func__, nContinuousStates);
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[], size_t
    nContinuousStates)
{
    OF_EXCHANGE(INITIALISED)
    (void)derivatives;
    return no_states(c, __func__, nContinuousStates);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[], size_t nEventIndicators)
{
    OF_EXCHANGE(INITIALISED)
    (void)eventIndicators;
    return no_states(c, __func__, nEventIndicators);
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[], size_t nContinuousStates)
{
    OF_EXCHANGE(INITIALISED)
    (void)continuousStates;
    return no_states(c, __func__, nContinuousStates);
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t nContinuousStates)
{
    OF_EXCHANGE(INITIALISED)
    (void)nominals;
    return no_states(c, __func__, nContinuousStates);
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators)
{
    OF_EXCHANGE(ANY_PHASE)
    if (!nEventIndicators) {
        return refuse(c, "%s: there is no place for what it returns", __func__);
    }
    *nEventIndicators = 0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates)
{
    OF_EXCHANGE(ANY_PHASE)
    if (!nContinuousStates) {
        return refuse(c, "%s: there is no place for what it returns", __func__);
    }
    *nContinuousStates = 0;
    return fmi3OK;
}
