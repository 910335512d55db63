/* The functions that FMI 3.0 demands of every FMU, for what these do not have. */
#include "cfem_fmi3.h"
#include "cfem_fmu.h"

#define NONE(instance, n, what) ((n) ? cfem_fmu_refuse(instance, "this FMU has no " what) : fmi3OK)
#define NO_VARIABLES(type) \
    FMI3_Export fmi3Status FMI(Get##type)(fmi3Instance u, const fmi3ValueReference which[], size_t n, fmi3##type values[], size_t m) { \
        (void)which, (void)values, (void)m; \
        return NONE(u, n, "variables of type " #type); \
    } \
    FMI3_Export fmi3Status FMI(Set##type)(fmi3Instance u, const fmi3ValueReference which[], size_t n, const fmi3##type values[], size_t m) { \
        (void)which, (void)values, (void)m; \
        return NONE(u, n, "variables of type " #type); \
    }
NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

#define ABSENT(name, what, ...) \
    FMI3_Export fmi3Status FMI(name)(fmi3Instance u, __VA_ARGS__) { return cfem_fmu_refuse(u, "this FMU has no " what); }
#define ABSENT_MODE(name, what) \
    FMI3_Export fmi3Status FMI(name)(fmi3Instance u) { return cfem_fmu_refuse(u, "this FMU has no " what); }
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
#define WHICH const fmi3ValueReference which[], size_t n
ABSENT(GetBinary, "variables of type Binary", WHICH, size_t sizes[], fmi3Binary values[], size_t m)
ABSENT(SetBinary, "variables of type Binary", WHICH, const size_t sizes[], const fmi3Binary values[], size_t m)
ABSENT(GetClock, "clocks", WHICH, fmi3Clock values[])
ABSENT(SetClock, "clocks", WHICH, const fmi3Clock values[])
ABSENT(GetIntervalDecimal, "clocks", WHICH, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
ABSENT(GetIntervalFraction, "clocks", WHICH, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
ABSENT(GetShiftDecimal, "clocks", WHICH, fmi3Float64 shifts[])
ABSENT(GetShiftFraction, "clocks", WHICH, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
ABSENT(SetIntervalDecimal, "clocks", WHICH, const fmi3Float64 intervals[])
ABSENT(SetIntervalFraction, "clocks", WHICH, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
ABSENT(SetShiftDecimal, "clocks", WHICH, const fmi3Float64 shifts[])
ABSENT(SetShiftFraction, "clocks", WHICH, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
ABSENT(ActivateModelPartition, "clocks", fmi3ValueReference clock, fmi3Float64 time)
ABSENT(GetNumberOfVariableDependencies, "dependencies to ask for", fmi3ValueReference which, size_t *n)
ABSENT(GetVariableDependencies, "dependencies to ask for", fmi3ValueReference which, size_t of[], fmi3ValueReference on[], size_t by[],
       fmi3DependencyKind kinds[], size_t n)
ABSENT(GetDirectionalDerivative, "derivatives", const fmi3ValueReference of[], size_t n, const fmi3ValueReference by[], size_t m,
       const fmi3Float64 seed[], size_t k, fmi3Float64 values[], size_t l)
ABSENT(GetAdjointDerivative, "derivatives", const fmi3ValueReference of[], size_t n, const fmi3ValueReference by[], size_t m,
       const fmi3Float64 seed[], size_t k, fmi3Float64 values[], size_t l)
ABSENT(GetOutputDerivatives, "derivatives", WHICH, const fmi3Int32 orders[], fmi3Float64 values[], size_t m)
ABSENT_MODE(EvaluateDiscreteStates, "event mode")
ABSENT_MODE(EnterStepMode, "event mode")
ABSENT_MODE(EnterConfigurationMode, "parameters of its structure")
ABSENT_MODE(ExitConfigurationMode, "parameters of its structure")
#if !CFEM_FMU_STATES
ABSENT(UpdateDiscreteStates, "event mode", fmi3Boolean *more, fmi3Boolean *end, fmi3Boolean *nominals, fmi3Boolean *values, fmi3Boolean *next,
       fmi3Float64 *time)
ABSENT(CompletedIntegratorStep, "model exchange", fmi3Boolean keeps, fmi3Boolean *event, fmi3Boolean *end)
ABSENT(SetTime, "model exchange", fmi3Float64 time)
ABSENT(SetContinuousStates, "model exchange", const fmi3Float64 states[], size_t n)
ABSENT(GetContinuousStateDerivatives, "model exchange", fmi3Float64 derivatives[], size_t n)
ABSENT(GetEventIndicators, "model exchange", fmi3Float64 indicators[], size_t n)
ABSENT(GetContinuousStates, "model exchange", fmi3Float64 states[], size_t n)
ABSENT(GetNominalsOfContinuousStates, "model exchange", fmi3Float64 nominals[], size_t n)
ABSENT(GetNumberOfEventIndicators, "model exchange", size_t *n)
ABSENT(GetNumberOfContinuousStates, "model exchange", size_t *n)
ABSENT_MODE(EnterEventMode, "event mode")
ABSENT_MODE(EnterContinuousTimeMode, "model exchange")
#endif
