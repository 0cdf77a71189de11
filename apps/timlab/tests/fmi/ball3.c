#include <stdlib.h>
#include <string.h>
#include <math.h>
/* A ball that falls and bounces; thrown by u (m/s²). Value references: 0 h, 1 v, 2 u, 3 e, 4 bounces. */
typedef struct { double h, v, u, e, now; int bounces; double before; } Ball;
static void start(Ball *b) { memset(b, 0, sizeof *b); b->h = 1; b->e = 0.5; }
static double *real(Ball *b, unsigned which) { double *all[] = {&b->h, &b->v, &b->u, &b->e}; return all[which]; }
static void bounce(Ball *b) { if (b->h <= 0 && b->v < 0) { b->h = 0; b->v *= -b->e; ++b->bounces; } }
static void slopes(Ball *b, double d[]) { d[0] = b->v; d[1] = b->u - 9.81; }

#include "fmi3Functions.h"
#define B ((Ball *)c)
fmi3Instance fmi3InstantiateModelExchange(fmi3String n, fmi3String g, fmi3String r, fmi3Boolean v, fmi3Boolean l, fmi3InstanceEnvironment e, fmi3LogMessageCallback m)
{ Ball *b = malloc(sizeof *b); start(b); return b; }
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean d, fmi3Float64 t, fmi3Float64 s, fmi3Boolean e, fmi3Float64 p) { B->now = s; return fmi3OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference w[], size_t n, fmi3Float64 x[], size_t k)
{ for (size_t i = 0; i < n; ++i) x[i] = *real(B, w[i]); return fmi3OK; }
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference w[], size_t n, const fmi3Float64 x[], size_t k)
{ for (size_t i = 0; i < n; ++i) *real(B, w[i]) = x[i]; return fmi3OK; }
fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference w[], size_t n, fmi3Int32 x[], size_t k)
{ for (size_t i = 0; i < n; ++i) x[i] = B->bounces; return fmi3OK; }
fmi3Status fmi3EnterEventMode(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *a, fmi3Boolean *t, fmi3Boolean *n, fmi3Boolean *v, fmi3Boolean *d, fmi3Float64 *e)
{ bounce(B); *a = *t = *n = *v = *d = 0; return fmi3OK; }
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean k, fmi3Boolean *e, fmi3Boolean *t) { *e = *t = 0; return fmi3OK; }
fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 t) { B->now = t; return fmi3OK; }
fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) { B->h = x[0]; B->v = x[1]; return fmi3OK; }
fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) { x[0] = B->h; x[1] = B->v; return fmi3OK; }
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 x[], size_t n) { slopes(B, x); return fmi3OK; }
fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 x[], size_t n) { x[0] = B->h; return fmi3OK; }
fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *s) { if (!*s) *s = malloc(sizeof(Ball)); memcpy(*s, c, sizeof(Ball)); return fmi3OK; }
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState s) { memcpy(c, s, sizeof(Ball)); return fmi3OK; }
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *s) { free(*s); *s = NULL; return fmi3OK; }
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState s, size_t *n) { *n = sizeof(Ball); return fmi3OK; }
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState s, fmi3Byte b[], size_t n) { memcpy(b, s, n); return fmi3OK; }
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte b[], size_t n, fmi3FMUState *s)
{ if (!*s) *s = malloc(n); memcpy(*s, b, n); return fmi3OK; }
