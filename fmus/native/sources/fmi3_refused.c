/* FMI 3.0: functions of what the component has not. They refuse, and say so. */
#include "fmi3Functions.h"

#include "component.h"

static fmi3Status lacking(fmi3Instance instance, const char *call, const char *what)
{
    return may(instance, call, ANY_PHASE) ? refuse(instance, "%s: the FMU has no %s", call, what) : fmi3Error;
}

fmi3Status fmi3GetFloat32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Float32 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3GetInt8(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Int8 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3GetUInt8(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3UInt8 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3GetInt16(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Int16 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3GetUInt16(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3UInt16 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3GetUInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3UInt32 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3GetUInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3UInt64 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3GetString(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3String values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    size_t valueSizes[], fmi3Binary values[], size_t nValues)
{
    (void)valueReferences;
    (void)valueSizes;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Clock values[])
{
    (void)valueReferences;
    (void)values;
    return nValueReferences ? lacking(instance, __func__, "clocks") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SetFloat32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Float32 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SetInt8(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Int8 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SetUInt8(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3UInt8 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SetInt16(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Int16 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SetUInt16(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3UInt16 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SetUInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3UInt32 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SetUInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3UInt64 values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SetString(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3String values[], size_t nValues)
{
    (void)valueReferences;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
{
    (void)valueReferences;
    (void)valueSizes;
    (void)values;
    (void)nValues;
    return nValueReferences ? lacking(instance, __func__, "variable of this type") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Clock values[])
{
    (void)valueReferences;
    (void)values;
    return nValueReferences ? lacking(instance, __func__, "clocks") : may(instance, __func__, ANY_PHASE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference valueReference, size_t
    *nDependencies)
{
    (void)valueReference;
    (void)nDependencies;
    return lacking(instance, __func__, "dependencies of single elements");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent, size_t
    elementIndicesOfDependent[], fmi3ValueReference independents[], size_t elementIndicesOfIndependents[],
    fmi3DependencyKind dependencyKinds[], size_t nDependencies)
{
    (void)dependent;
    (void)elementIndicesOfDependent;
    (void)independents;
    (void)elementIndicesOfIndependents;
    (void)dependencyKinds;
    (void)nDependencies;
    return lacking(instance, __func__, "dependencies of single elements");
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64
    sensitivity[], size_t nSensitivity)
{
    (void)unknowns;
    (void)nUnknowns;
    (void)knowns;
    (void)nKnowns;
    (void)seed;
    (void)nSeed;
    (void)sensitivity;
    (void)nSensitivity;
    return lacking(instance, __func__, "derivatives");
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance)
{
    return lacking(instance, __func__, "structural parameters");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance)
{
    return lacking(instance, __func__, "structural parameters");
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t
    nValueReferences, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)intervals;
    (void)qualifiers;
    return lacking(instance, __func__, "clocks");
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t
    nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)counters;
    (void)resolutions;
    (void)qualifiers;
    return lacking(instance, __func__, "clocks");
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t
    nValueReferences, fmi3Float64 shifts[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)shifts;
    return lacking(instance, __func__, "clocks");
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t
    nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)counters;
    (void)resolutions;
    return lacking(instance, __func__, "clocks");
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t
    nValueReferences, const fmi3Float64 intervals[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)intervals;
    return lacking(instance, __func__, "clocks");
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t
    nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)counters;
    (void)resolutions;
    return lacking(instance, __func__, "clocks");
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t
    nValueReferences, const fmi3Float64 shifts[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)shifts;
    return lacking(instance, __func__, "clocks");
}

fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t
    nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)counters;
    (void)resolutions;
    return lacking(instance, __func__, "clocks");
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    return lacking(instance, __func__, "event mode");
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t
    nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues)
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)orders;
    (void)values;
    (void)nValues;
    return lacking(instance, __func__, "derivatives of outputs");
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference, fmi3Float64
    activationTime)
{
    (void)clockReference;
    (void)activationTime;
    return lacking(instance, __func__, "scheduled execution");
}
