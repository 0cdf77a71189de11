typedef struct { int again, terminate, nominals, values, timed; double next; } Event;

EXPORT int fmi2EnterEventMode(void *m) { (void)m; return 0; }
EXPORT int fmi2NewDiscreteStates(void *m, Event *event) { (void)m; memset(event, 0, sizeof *event); return 0; }
EXPORT int fmi2EnterContinuousTimeMode(void *m) { (void)m; return 0; }
EXPORT int fmi2CompletedIntegratorStep(void *m, int kept, int *event, int *end) { (void)m; (void)kept; *event = *end = 0; return 0; }
EXPORT int fmi2SetTime(void *m, double time) { ((Model *)m)->data.time = time; ((Model *)m)->stale = true; return 0; }
EXPORT int fmi2GetEventIndicators(void *m, double values[], size_t n) { (void)m; (void)values; return n ? 3 : 0; }

EXPORT int fmi2SetContinuousStates(void *m, const double values[], size_t n)
{
    if (n != STATES) return 3;
    memcpy(((Model *)m)->data.states, values, n * sizeof *values);
    ((Model *)m)->stale = true;
    return 0;
}

EXPORT int fmi2GetContinuousStates(void *m, double values[], size_t n)
{
    if (n != STATES) return 3;
    memcpy(values, ((Model *)m)->data.states, n * sizeof *values);
    return 0;
}

EXPORT int fmi2GetDerivatives(void *m, double values[], size_t n)
{
    if (n != STATES) return 3;
    refresh(m);
    memcpy(values, ((Model *)m)->data.slopes, n * sizeof *values);
    return soundness(m);
}

EXPORT int fmi2GetNominalsOfContinuousStates(void *m, double values[], size_t n)
{
    (void)m;
    for (size_t k = 0; k < n; ++k) values[k] = 1;
    return 0;
}
