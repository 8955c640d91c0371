/* Calls of FMI 3.0 that these FMUs must have and do not support; a part of fmi3_slave.h. */

#include "fmi3_modes.h"

#define UNSUPPORTED(name, parameters) CALL(name, parameters, 1, refuse_call(s, ERROR))
/* No variable is of that type. */
#define NO_SUCH_TYPE(name, type) \
    CALL(fmi3Get##name, (Component c, const Reference r[], size_t n, type v[], size_t total), n == 0 || r, \
         refuse_types(s, r, n)) \
    CALL(fmi3Set##name, (Component c, const Reference r[], size_t n, const type v[], size_t total), n == 0 || r, \
         refuse_types(s, r, n))

#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

NO_SUCH_TYPE(Float32, float)
NO_SUCH_TYPE(Int8, int8_t)
NO_SUCH_TYPE(UInt8, uint8_t)
NO_SUCH_TYPE(Int16, int16_t)
NO_SUCH_TYPE(UInt16, uint16_t)
NO_SUCH_TYPE(UInt32, uint32_t)
NO_SUCH_TYPE(UInt64, uint64_t)
NO_SUCH_TYPE(Boolean, bool)
NO_SUCH_TYPE(String, String)

CALL(fmi3GetBinary, (Component c, const Reference r[], size_t n, size_t sizes[], const Byte *v[], size_t total), n == 0 || r,
     refuse_types(s, r, n))
CALL(fmi3SetBinary,
     (Component c, const Reference r[], size_t n, const size_t sizes[], const Byte *const v[], size_t total), n == 0 || r,
     refuse_types(s, r, n))

UNSUPPORTED(fmi3GetNumberOfVariableDependencies, (Component c, Reference r, size_t *n))
UNSUPPORTED(fmi3GetVariableDependencies, (Component c, Reference r, size_t of[], Reference by[], size_t elements[],
                                          int kinds[], size_t n))
#ifndef DIRECTIONAL
UNSUPPORTED(fmi3GetDirectionalDerivative, (Component c, const Reference u[], size_t n, const Reference k[], size_t m,
                                           const double dk[], size_t ndk, double du[], size_t ndu))
#endif
UNSUPPORTED(fmi3GetAdjointDerivative, (Component c, const Reference u[], size_t n, const Reference k[], size_t m,
                                       const double dk[], size_t ndk, double du[], size_t ndu))
UNSUPPORTED(fmi3EnterConfigurationMode, (Component c))
UNSUPPORTED(fmi3ExitConfigurationMode, (Component c))
UNSUPPORTED(fmi3GetIntervalFraction, (Component c, const Reference r[], size_t n, uint64_t counters[],
                                      uint64_t resolutions[], IntervalQualifier q[]))
UNSUPPORTED(fmi3GetShiftFraction, (Component c, const Reference r[], size_t n, uint64_t counters[], uint64_t resolutions[]))
UNSUPPORTED(fmi3SetIntervalFraction, (Component c, const Reference r[], size_t n, const uint64_t counters[],
                                      const uint64_t resolutions[]))
UNSUPPORTED(fmi3SetShiftFraction, (Component c, const Reference r[], size_t n, const uint64_t counters[],
                                   const uint64_t resolutions[]))
UNSUPPORTED(fmi3EvaluateDiscreteStates, (Component c))
UNSUPPORTED(fmi3ActivateModelPartition, (Component c, Reference clock, double time))
#ifndef SAMPLE_TIME
CALL(fmi3GetClock, (Component c, const Reference r[], size_t n, bool v[]), n == 0 || r, refuse_types(s, r, n))
CALL(fmi3SetClock, (Component c, const Reference r[], size_t n, const bool v[]), n == 0 || r, refuse_types(s, r, n))
UNSUPPORTED(fmi3GetIntervalDecimal, (Component c, const Reference r[], size_t n, double v[], IntervalQualifier q[]))
UNSUPPORTED(fmi3GetShiftDecimal, (Component c, const Reference r[], size_t n, double v[]))
UNSUPPORTED(fmi3SetIntervalDecimal, (Component c, const Reference r[], size_t n, const double v[]))
UNSUPPORTED(fmi3SetShiftDecimal, (Component c, const Reference r[], size_t n, const double v[]))
#endif
#ifndef CONTINUOUS_STATES
UNSUPPORTED(fmi3GetOutputDerivatives, (Component c, const Reference r[], size_t n, const int32_t orders[], double v[],
                                       size_t total))
UNSUPPORTED(fmi3GetNumberOfContinuousStates, (Component c, size_t *n))
UNSUPPORTED(fmi3GetNumberOfEventIndicators, (Component c, size_t *n))
UNSUPPORTED(fmi3SetContinuousStates, (Component c, const double x[], size_t n))
UNSUPPORTED(fmi3GetContinuousStates, (Component c, double x[], size_t n))
UNSUPPORTED(fmi3GetNominalsOfContinuousStates, (Component c, double x[], size_t n))
UNSUPPORTED(fmi3GetContinuousStateDerivatives, (Component c, double x[], size_t n))
UNSUPPORTED(fmi3GetEventIndicators, (Component c, double x[], size_t n))
UNSUPPORTED(fmi3CompletedIntegratorStep, (Component c, bool no_return, bool *event, bool *end))
#endif

#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif
