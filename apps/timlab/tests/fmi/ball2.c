#include <stdlib.h>
#include <string.h>
#include <math.h>
/* A ball that falls and bounces; thrown by u (m/s²). Value references: 0 h, 1 v, 2 u, 3 e, 4 bounces. */
typedef struct { double h, v, u, e, now; int bounces; double before; } Ball;
static void start(Ball *b) { memset(b, 0, sizeof *b); b->h = 1; b->e = 0.5; }
static double *real(Ball *b, unsigned which) { double *all[] = {&b->h, &b->v, &b->u, &b->e}; return all[which]; }
static void bounce(Ball *b) { if (b->h <= 0 && b->v < 0) { b->h = 0; b->v *= -b->e; ++b->bounces; } }
static void slopes(Ball *b, double d[]) { d[0] = b->v; d[1] = b->u - 9.81; }

#include "fmi2Functions.h"
#define B ((Ball *)c)
fmi2Component fmi2Instantiate(fmi2String n, fmi2Type t, fmi2String g, fmi2String r, const fmi2CallbackFunctions *f, fmi2Boolean v, fmi2Boolean l)
{ Ball *b = malloc(sizeof *b); start(b); return b; }
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean d, fmi2Real t, fmi2Real s, fmi2Boolean e, fmi2Real p) { B->now = s; return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference w[], size_t n, fmi2Real x[])
{ for (size_t i = 0; i < n; ++i) x[i] = *real(B, w[i]); return fmi2OK; }
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference w[], size_t n, const fmi2Real x[])
{ for (size_t i = 0; i < n; ++i) { if (!isfinite(x[i])) return fmi2Error; *real(B, w[i]) = x[i]; } return fmi2OK; }
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference w[], size_t n, fmi2Integer x[])
{ for (size_t i = 0; i < n; ++i) x[i] = B->bounces; return fmi2OK; }
fmi2Status fmi2EnterEventMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{ bounce(B); memset(info, 0, sizeof *info); return fmi2OK; }
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean k, fmi2Boolean *e, fmi2Boolean *t) { *e = *t = 0; return fmi2OK; }
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real t) { B->now = t; return fmi2OK; }
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) { B->h = x[0]; B->v = x[1]; return fmi2OK; }
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) { x[0] = B->h; x[1] = B->v; return fmi2OK; }
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real x[], size_t n) { slopes(B, x); return fmi2OK; }
fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real x[], size_t n) { x[0] = B->h; return fmi2OK; }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean k)
{ for (int i = 0; i < 1000; ++i) { B->v += h / 1000 * (B->u - 9.81); B->h += h / 1000 * B->v; bounce(B); } return fmi2OK; }
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s) { if (!*s) *s = malloc(sizeof(Ball)); memcpy(*s, c, sizeof(Ball)); return fmi2OK; }
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) { memcpy(c, s, sizeof(Ball)); return fmi2OK; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s) { free(*s); *s = NULL; return fmi2OK; }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t *n) { *n = sizeof(Ball); return fmi2OK; }
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n) { memcpy(b, s, n); return fmi2OK; }
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s)
{ if (!*s) *s = malloc(n); memcpy(*s, b, n); return fmi2OK; }
