#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT int fmi3SetDebugLogging(void *m, bool on, size_t n, const char *const names[]) { (void)m; (void)on; (void)n; (void)names; return 0; }

typedef void (*Log)(void *, int, const char *, const char *);

static void tell(Instance *instance, int status, const char *message)
{
    char text[512];
    snprintf(text, sizeof text, "%s (at %.9g s)", message, instance->model.data.time);
    if (instance->log) ((Log)instance->log)(instance->environment, status, "logStatusError", text);
}

static void *instantiate(const char *token, void *environment, const void *log)
{
    if (strcmp(token, "$guid") != 0) return NULL;
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance) return NULL;
    begin(&instance->model);
    instance->environment = environment;
    instance->log = (void (*)(void))log;
    return instance;
}

EXPORT void *fmi3InstantiateScheduledExecution(void) { return NULL; }
EXPORT void fmi3FreeInstance(void *m) { free(m); }

EXPORT int fmi3EnterInitializationMode(void *m, bool given, double tolerance, double start, bool stops, double stop)
{
    (void)given; (void)tolerance; (void)stops; (void)stop;
    ((Model *)m)->data.time = start;
    ((Model *)m)->stale = true;
    return starts_at(start) ? 0 : 3;
}

EXPORT int fmi3ExitInitializationMode(void *m) { (void)m; return 0; }
EXPORT int fmi3Terminate(void *m) { (void)m; return 0; }
EXPORT int fmi3Reset(void *m) { begin(m); return 0; }

#define ACCESS(NAME, KIND, TYPE) \
EXPORT int fmi3Get##NAME(void *m, const uint32_t which[], size_t n, TYPE values[], size_t count) \
{ \
    size_t made = 0; \
    refresh(m); \
    for (size_t k = 0; k < n; ++k) { \
        if (which[k] >= COUNT || !right(&VARIABLES[which[k]], KIND)) return 3; \
        const Variable *variable = &VARIABLES[which[k]]; \
        if (made + variable->count > count) return 3; \
        for (int i = 0; i < variable->count; ++i) values[made++] = (TYPE)get_element(&((Model *)m)->data, variable, i); \
    } \
    return made == count ? 0 : 3; \
} \
EXPORT int fmi3Set##NAME(void *m, const uint32_t which[], size_t n, const TYPE values[], size_t count) \
{ \
    ((Model *)m)->stale = true; \
    size_t used = 0; \
    for (size_t k = 0; k < n; ++k) { \
        if (which[k] >= COUNT || VARIABLES[which[k]].kind != KIND || !VARIABLES[which[k]].input) return 3; \
        const Variable *variable = &VARIABLES[which[k]]; \
        if (used + variable->count > count) return 3; \
        for (int i = 0; i < variable->count; ++i) set_element(&((Model *)m)->data, variable, i, values[used++]); \
    } \
    return used == count ? 0 : 3; \
}
ACCESS(Float64, REAL, double)
ACCESS(Int32, INTEGER, int32_t)
ACCESS(Boolean, TRUTH, bool)

EXPORT int fmi3GetFMUState(void *m, void **state)
{
    if (!*state) *state = malloc(sizeof(Model));
    if (!*state) return 3;
    memcpy(*state, m, sizeof(Model));
    return 0;
}

EXPORT int fmi3SetFMUState(void *m, void *state) { memcpy(m, state, sizeof(Model)); return 0; }
EXPORT int fmi3FreeFMUState(void *m, void **state) { (void)m; free(*state); *state = NULL; return 0; }
EXPORT int fmi3SerializedFMUStateSize(void *m, void *state, size_t *size) { (void)m; (void)state; *size = sizeof(Model); return 0; }
EXPORT int fmi3SerializeFMUState(void *m, void *state, uint8_t bytes[], size_t size)
{
    (void)m;
    if (size < sizeof(Model)) return 3;
    memcpy(bytes, state, sizeof(Model));
    return 0;
}
EXPORT int fmi3DeserializeFMUState(void *m, const uint8_t bytes[], size_t size, void **state)
{
    (void)m;
    if (size != sizeof(Model)) return 3;
    if (!*state) *state = malloc(sizeof(Model));
    if (!*state) return 3;
    memcpy(*state, bytes, sizeof(Model));
    return 0;
}

$interface
/* What the unit does not offer: each refuses, whatever it is given. */
$refused
