EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *place, bool visible, bool logging, void *environment, const void *message)
{
    (void)name; (void)place; (void)visible; (void)logging;
    return instantiate(token, environment, message);
}

EXPORT void *fmi3InstantiateCoSimulation(void) { return NULL; }
EXPORT int fmi3EnterEventMode(void *m) { (void)m; return 0; }
EXPORT int fmi3UpdateDiscreteStates(void *m, bool *again, bool *end, bool *nominals, bool *values, bool *timed, double *next)
{
    (void)m; (void)next;
    *again = *end = *nominals = *values = *timed = false;
    return 0;
}
EXPORT int fmi3EnterContinuousTimeMode(void *m) { (void)m; return 0; }
EXPORT int fmi3CompletedIntegratorStep(void *m, bool kept, bool *event, bool *end) { (void)m; (void)kept; *event = *end = false; return 0; }
EXPORT int fmi3SetTime(void *m, double time) { ((Model *)m)->data.time = time; ((Model *)m)->stale = true; return 0; }
EXPORT int fmi3GetEventIndicators(void *m, double values[], size_t n) { (void)m; (void)values; return n ? 3 : 0; }

EXPORT int fmi3SetContinuousStates(void *m, const double values[], size_t n)
{
    if (n != STATES) return 3;
    memcpy(((Model *)m)->data.states, values, n * sizeof *values);
    ((Model *)m)->stale = true;
    return 0;
}

EXPORT int fmi3GetContinuousStates(void *m, double values[], size_t n)
{
    if (n != STATES) return 3;
    memcpy(values, ((Model *)m)->data.states, n * sizeof *values);
    return 0;
}

EXPORT int fmi3GetContinuousStateDerivatives(void *m, double values[], size_t n)
{
    if (n != STATES) return 3;
    refresh(m);
    memcpy(values, ((Model *)m)->data.slopes, n * sizeof *values);
    return soundness(m);
}

EXPORT int fmi3GetNominalsOfContinuousStates(void *m, double values[], size_t n)
{
    (void)m;
    for (size_t k = 0; k < n; ++k) values[k] = 1;
    return 0;
}

EXPORT int fmi3GetNumberOfEventIndicators(void *m, size_t *n) { (void)m; *n = 0; return 0; }
EXPORT int fmi3GetNumberOfContinuousStates(void *m, size_t *n) { (void)m; *n = STATES; return 0; }
