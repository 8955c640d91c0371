#!/usr/bin/env bash
# Guess: CasADi leaves an FMU's Integer outputs out of y, or converts them; it sets states by fmi2SetContinuousStates.
#   pathsim-fmi refuses an FMU with Integer outputs, or shows them.
# What happens: both read every output by fmi2GetReal. Value references of FMI 2.0 are counted for each type, so the
#   Integer output of value reference 1, which is 7, is shown as the Real variable of value reference 1, which is 42.5:
#   without a message. CasADi sets states one by one with fmi2SetReal, and never calls fmi2SetContinuousStates, so an FMU
#   that takes states by the function made for them alone cannot be evaluated.
# Version: casadi 3.8.2, pathsim 0.27.1, pathsim-fmi 0.1.1, FMPy 0.3.32, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q casadi==3.8.2 pathsim==0.27.1 pathsim-fmi==0.1.1 fmpy==0.3.32 ziglang==0.17.1

# An FMU for model exchange: x' = -x, an Integer output `count` = 7 and a Real parameter `mass` = 42.5.
cat > lag.c <<'C'
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#define EXPORT __attribute__((visibility("default")))
typedef void *Component;
typedef unsigned Ref;
typedef struct { int newStates, end, nominals, values, hasNext; double next; } Events;
static double real[3] = {1.0, 42.5, 0.0}; /* x, mass, der(x) */
static void trace(const char *name)
{
    const char *path = getenv("TRACE");
    FILE *file = path ? fopen(path, "a") : NULL;
    if (file) { fprintf(file, "%s\n", name); fclose(file); }
}
#define PLAIN(name, ...) EXPORT int name(__VA_ARGS__) { trace(#name); return 0; }
EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT Component fmi2Instantiate(const char *n, int t, const char *g, const char *r, const void *f, int v, int l)
{ real[0] = 1.0; return real; }
EXPORT void fmi2FreeInstance(Component c) {}
PLAIN(fmi2SetDebugLogging, Component c, int on, size_t n, const char *const names[])
PLAIN(fmi2SetupExperiment, Component c, int a, double b, double d, int e, double f)
PLAIN(fmi2EnterInitializationMode, Component c)
PLAIN(fmi2ExitInitializationMode, Component c)
PLAIN(fmi2Terminate, Component c)
PLAIN(fmi2Reset, Component c)
EXPORT int fmi2GetReal(Component c, const Ref r[], size_t n, double v[])
{ trace("fmi2GetReal"); real[2] = -real[0]; for (size_t k = 0; k < n; k++) v[k] = real[r[k]]; return 0; }
EXPORT int fmi2SetReal(Component c, const Ref r[], size_t n, const double v[])
{ trace("fmi2SetReal"); for (size_t k = 0; k < n; k++) real[r[k]] = v[k]; return 0; }
EXPORT int fmi2GetInteger(Component c, const Ref r[], size_t n, int v[])
{ trace("fmi2GetInteger"); for (size_t k = 0; k < n; k++) v[k] = 7; return 0; }
PLAIN(fmi2GetBoolean, Component c, const Ref r[], size_t n, int v[])
PLAIN(fmi2GetString, Component c, const Ref r[], size_t n, const char *v[])
PLAIN(fmi2SetInteger, Component c, const Ref r[], size_t n, const int v[])
PLAIN(fmi2SetBoolean, Component c, const Ref r[], size_t n, const int v[])
PLAIN(fmi2SetString, Component c, const Ref r[], size_t n, const char *const v[])
PLAIN(fmi2GetFMUstate, Component c, void **s)
PLAIN(fmi2SetFMUstate, Component c, void *s)
PLAIN(fmi2FreeFMUstate, Component c, void **s)
PLAIN(fmi2SerializedFMUstateSize, Component c, void *s, size_t *n)
PLAIN(fmi2SerializeFMUstate, Component c, void *s, char b[], size_t n)
PLAIN(fmi2DeSerializeFMUstate, Component c, const char b[], size_t n, void **s)
PLAIN(fmi2GetDirectionalDerivative, Component c, const Ref u[], size_t n, const Ref k[], size_t m, const double a[], double b[])
PLAIN(fmi2EnterEventMode, Component c)
EXPORT int fmi2NewDiscreteStates(Component c, Events *e) { *e = (Events){0}; return 0; }
PLAIN(fmi2EnterContinuousTimeMode, Component c)
EXPORT int fmi2CompletedIntegratorStep(Component c, int no, int *event, int *end) { *event = *end = 0; return 0; }
PLAIN(fmi2SetTime, Component c, double t)
EXPORT int fmi2SetContinuousStates(Component c, const double x[], size_t n)
{ trace("fmi2SetContinuousStates"); real[0] = x[0]; return 0; }
EXPORT int fmi2GetDerivatives(Component c, double d[], size_t n) { trace("fmi2GetDerivatives"); d[0] = -real[0]; return 0; }
PLAIN(fmi2GetEventIndicators, Component c, double v[], size_t n)
EXPORT int fmi2GetContinuousStates(Component c, double x[], size_t n) { x[0] = real[0]; return 0; }
EXPORT int fmi2GetNominalsOfContinuousStates(Component c, double x[], size_t n) { x[0] = 1.0; return 0; }
C
mkdir -p fmu/binaries/linux64
venv/bin/python -m ziglang cc -shared -fPIC -O1 -w -o fmu/binaries/linux64/Lag.so lag.c
cat > fmu/modelDescription.xml <<'XML'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Lag" guid="{1}" numberOfEventIndicators="0">
  <ModelExchange modelIdentifier="Lag"/>
  <ModelVariables>
    <ScalarVariable name="x" valueReference="0" causality="output" variability="continuous" initial="exact"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="der(x)" valueReference="2" causality="local" variability="continuous"><Real derivative="1"/></ScalarVariable>
    <ScalarVariable name="mass" valueReference="1" causality="parameter" variability="fixed"><Real start="42.5"/></ScalarVariable>
    <ScalarVariable name="count" valueReference="1" causality="output" variability="discrete" initial="calculated"><Integer/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="1"/><Unknown index="4" dependencies=""/></Outputs>
    <Derivatives><Unknown index="2" dependencies="1"/></Derivatives>
    <InitialUnknowns><Unknown index="2"/><Unknown index="4"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
XML
(cd fmu && ../venv/bin/python -m zipfile -c ../Lag.fmu modelDescription.xml binaries)

cat > run.py <<'PYTHON'
import os, sys
from collections import Counter
import fmpy
from fmpy.validation import validate_fmu

print("FMPy", fmpy.__version__, "problems of the FMU:", validate_fmu("Lag.fmu"))
row = fmpy.simulate_fmu("Lag.fmu", stop_time=0.1, output_interval=0.1, output=["x", "count"])[0]
print("FMPy: count =", row["count"])
assert row["count"] == 7 and row["x"] == 1.0

import pathsim_fmi

block = pathsim_fmi.ModelExchangeFMU("Lag.fmu")
shown = dict(zip(block.fmu_wrapper.output_refs, map(float, block.fmu_wrapper.get_outputs_as_array())))
print("pathsim-fmi:", shown)
assert shown == {"x": 1.0, "count": 42.5}

os.environ["TRACE"] = "calls.txt"
import casadi

dae = casadi.DaeBuilder("lag", "Lag.fmu")
f = dae.create("f", ["x"], ["ode", "y"])
open("calls.txt", "w").close()
ode, y = f(3.0)
calls = Counter(open("calls.txt").read().split())
print("CasADi", casadi.__version__, "y:", dict(zip(dae.y(), map(float, casadi.vertsplit(y)))), "calls:", dict(calls))
assert dae.y() == ["x", "count"] and float(ode) == -3.0 and float(y[1]) == 42.5
assert calls["fmi2SetReal"] and not calls["fmi2SetContinuousStates"] and not calls["fmi2GetInteger"]
PYTHON
venv/bin/python run.py
echo "as described"
