/* A co-simulation FMU with inputs and outputs of every numeric type; y integrates, m counts, c compares. */
#include <stdlib.h>
#include <string.h>
#include "fmi2FunctionTypes.h"



typedef struct { double u, y; int n, m, b; const fmi2CallbackFunctions *host; } Mixed;

#define NOTHING(NAME, ...) fmi2Status NAME(fmi2Component c, ##__VA_ARGS__) { (void)c; return fmi2OK; }

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String uri,
                              const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging) {
    Mixed *m = calloc(1, sizeof *m);
    (void)name; (void)type; (void)guid; (void)uri; (void)visible; (void)logging;
    m->host = host;
    return m;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2Reset(fmi2Component c) {
    const fmi2CallbackFunctions *host = ((Mixed *)c)->host;
    memset(c, 0, sizeof(Mixed));
    ((Mixed *)c)->host = host;
    return fmi2OK;
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real d, fmi2Boolean e, fmi2Real f) {
    (void)c; (void)a; (void)b; (void)d; (void)e; (void)f;
    return fmi2OK;
}
/* Loaders ask for every function of the standard. */
#define UNUSED(NAME) int NAME(void) { return fmi2Error; }
NOTHING(fmi2EnterInitializationMode)
NOTHING(fmi2ExitInitializationMode)
NOTHING(fmi2Terminate)
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String k[]) { (void)c; (void)on; (void)n; (void)k; return fmi2OK; }
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[]) { (void)r; (void)n; ((Mixed *)c)->u = v[0]; return fmi2OK; }
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer v[]) {
    Mixed *m = c;
    (void)r; (void)n;
    if (v[0] >= 99) {
        m->host->logger(m->host->componentEnvironment, "mixed", fmi2Discard, "logStatusDiscard", "99 and more is refused");
        return fmi2Discard;
    }
    m->n = v[0];
    return fmi2OK;
}
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Boolean v[]) { (void)r; (void)n; ((Mixed *)c)->b = v[0]; return fmi2OK; }
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[]) { (void)r; (void)n; v[0] = ((Mixed *)c)->y; return fmi2OK; }
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer v[]) { (void)r; (void)n; v[0] = ((Mixed *)c)->m; return fmi2OK; }
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Boolean v[]) { Mixed *m = c; (void)r; (void)n; v[0] = m->y > 0.0 || m->b; return fmi2OK; }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean k) {
    Mixed *m = c;
    (void)k;
    if (t > 0.01)
        m->host->logger(m->host->componentEnvironment, "mixed", fmi2Warning, "logStatusWarning", "late");
    m->y += h * (m->u + m->n);
    m->m += m->b ? 3 : 1;
    return fmi2OK;
}
UNUSED(fmi2GetString) UNUSED(fmi2SetString) UNUSED(fmi2CancelStep) UNUSED(fmi2GetStatus) UNUSED(fmi2GetRealStatus)
UNUSED(fmi2GetIntegerStatus) UNUSED(fmi2GetBooleanStatus) UNUSED(fmi2GetStringStatus) UNUSED(fmi2GetFMUstate)
UNUSED(fmi2SetFMUstate) UNUSED(fmi2FreeFMUstate) UNUSED(fmi2SerializedFMUstateSize) UNUSED(fmi2SerializeFMUstate)
UNUSED(fmi2DeSerializeFMUstate) UNUSED(fmi2GetDirectionalDerivative) UNUSED(fmi2SetRealInputDerivatives)
UNUSED(fmi2GetRealOutputDerivatives)
