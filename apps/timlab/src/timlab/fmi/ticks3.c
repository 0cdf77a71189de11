EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *place, bool visible, bool logging, bool events, bool early,
    const uint32_t required[], size_t n, void *environment, const void *message, const void *update)
{
    (void)name; (void)place; (void)visible; (void)logging; (void)events; (void)early; (void)required; (void)n;
    (void)update;
    return instantiate(token, environment, message);
}
EXPORT void *fmi3InstantiateModelExchange(void) { return NULL; }
EXPORT int fmi3EnterStepMode(void *m) { (void)m; return 0; }

EXPORT int fmi3DoStep(void *m, double now, double length, bool keep, bool *event, bool *over, bool *early, double *last)
{
    (void)keep;
    const int status = run(m, now, length);
    *event = *over = *early = false;
    *last = ((Model *)m)->data.time;
    return status;
}
