/* FMI 2.0 model exchange. */
#include "fmi2Functions.h"

#include "component.h"

#define EXCHANGING(phases)                                                                                             \
    Component *c = instance;                                                                                           \
    if (!may(c, __func__, phases)) {                                                                                   \
        return fmi2Error;                                                                                              \
    }

fmi2Status fmi2EnterEventMode(fmi2Component instance)
{
    EXCHANGING(IN(FLOWING) | IN(EVENTS))
    return change_phase(c, __func__, EVENTS);
}

fmi2Status fmi2NewDiscreteStates(fmi2Component instance, fmi2EventInfo *info)
{
    EXCHANGING(IN(EVENTS))
    if (!info) {
        return refuse(c, "%s: there is no place for what it returns", __func__);
    }
    info->newDiscreteStatesNeeded = fmi2False;
    info->terminateSimulation = fmi2False;
    info->nominalsOfContinuousStatesChanged = fmi2False;
    info->valuesOfContinuousStatesChanged = fmi2False;
    return update_events(c, __func__, &info->nextEventTimeDefined, &info->nextEventTime);
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component instance)
{
    EXCHANGING(IN(EVENTS))
    return change_phase(c, __func__, FLOWING);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component instance, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation)
{
    EXCHANGING(IN(FLOWING))
    (void)noSetFMUStatePriorToCurrentPoint;
    if (terminateSimulation) {
        *terminateSimulation = fmi2False;
    }
    return complete_step(c, __func__, enterEventMode);
}

fmi2Status fmi2SetTime(fmi2Component instance, fmi2Real time)
{
    EXCHANGING(IN(FLOWING) | IN(EVENTS))
    return set_time(c, __func__, time);
}

fmi2Status fmi2SetContinuousStates(fmi2Component instance, const fmi2Real x[], size_t nx)
{
    EXCHANGING(IN(FLOWING))
    (void)x;
    return no_states(c, __func__, nx);
}

fmi2Status fmi2GetDerivatives(fmi2Component instance, fmi2Real derivatives[], size_t nx)
{
    EXCHANGING(IN(FLOWING) | IN(EVENTS) | IN(FAILED) | IN(TERMINATED))
    (void)derivatives;
    return no_states(c, __func__, nx);
}

fmi2Status fmi2GetEventIndicators(fmi2Component instance, fmi2Real eventIndicators[], size_t ni)
{
    EXCHANGING(INITIALISED)
    (void)eventIndicators;
    return no_states(c, __func__, ni);
}

fmi2Status fmi2GetContinuousStates(fmi2Component instance, fmi2Real x[], size_t nx)
{
    EXCHANGING(INITIALISED)
    (void)x;
    return no_states(c, __func__, nx);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component instance, fmi2Real x_nominal[], size_t nx)
{
    EXCHANGING(INITIALISED)
    (void)x_nominal;
    return no_states(c, __func__, nx);
}
