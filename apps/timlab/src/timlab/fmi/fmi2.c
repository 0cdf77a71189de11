#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT int fmi2SetDebugLogging(void *m, int on, size_t n, const char *const names[]) { (void)m; (void)on; (void)n; (void)names; return 0; }

typedef void (*Log)(void *, const char *, int, const char *, const char *, ...);
typedef struct { Log log; void *allocate, *release, *finished, *environment; } Callbacks;

static void tell(Instance *instance, int status, const char *message)
{
    char text[512];
    snprintf(text, sizeof text, "%s (at %.9g s)", message, instance->model.data.time);
    if (instance->log) ((Log)instance->log)(instance->environment, instance->name, status, "logStatusError", text);
}

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *place, const void *functions, int visible, int logging)
{
    (void)place; (void)visible; (void)logging;
    if (type != $type || strcmp(guid, "$guid") != 0) return NULL;
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance) return NULL;
    begin(&instance->model);
    if (name) snprintf(instance->name, sizeof instance->name, "%s", name);
    if (functions) {
        instance->log = (void (*)(void))((const Callbacks *)functions)->log;
        instance->environment = ((const Callbacks *)functions)->environment;
    }
    return instance;
}

EXPORT void fmi2FreeInstance(void *m) { free(m); }

EXPORT int fmi2SetupExperiment(void *m, int given, double tolerance, double start, int stops, double stop)
{
    (void)given; (void)tolerance; (void)stops; (void)stop;
    ((Model *)m)->data.time = start;
    ((Model *)m)->stale = true;
    return starts_at(start) ? 0 : 3;
}

EXPORT int fmi2EnterInitializationMode(void *m) { (void)m; return 0; }
EXPORT int fmi2ExitInitializationMode(void *m) { (void)m; return 0; }
EXPORT int fmi2Terminate(void *m) { (void)m; return 0; }
EXPORT int fmi2Reset(void *m) { begin(m); return 0; }

#define ACCESS(NAME, KIND, TYPE) \
EXPORT int fmi2Get##NAME(void *m, const unsigned int which[], size_t n, TYPE values[]) \
{ \
    refresh(m); \
    for (size_t k = 0; k < n; ++k) { \
        if (which[k] >= COUNT || !right(&VARIABLES[which[k]], KIND)) return 3; \
        values[k] = (TYPE)get_element(&((Model *)m)->data, &VARIABLES[which[k]], 0); \
    } \
    return 0; \
} \
EXPORT int fmi2Set##NAME(void *m, const unsigned int which[], size_t n, const TYPE values[]) \
{ \
    ((Model *)m)->stale = true; \
    for (size_t k = 0; k < n; ++k) { \
        if (which[k] >= COUNT || VARIABLES[which[k]].kind != KIND || !VARIABLES[which[k]].input) return 3; \
        set_element(&((Model *)m)->data, &VARIABLES[which[k]], 0, values[k]); \
    } \
    return 0; \
}
ACCESS(Real, REAL, double)
ACCESS(Integer, INTEGER, int)
ACCESS(Boolean, TRUTH, int)
EXPORT int fmi2GetString(void *m, const unsigned int which[], size_t n, const char *values[]) { (void)m; (void)which; (void)values; return n ? 3 : 0; }
EXPORT int fmi2SetString(void *m, const unsigned int which[], size_t n, const char *const values[]) { (void)m; (void)which; (void)values; return n ? 3 : 0; }

EXPORT int fmi2GetFMUstate(void *m, void **state)
{
    if (!*state) *state = malloc(sizeof(Model));
    if (!*state) return 3;
    memcpy(*state, m, sizeof(Model));
    return 0;
}

EXPORT int fmi2SetFMUstate(void *m, void *state) { memcpy(m, state, sizeof(Model)); return 0; }
EXPORT int fmi2FreeFMUstate(void *m, void **state) { (void)m; free(*state); *state = NULL; return 0; }
EXPORT int fmi2SerializedFMUstateSize(void *m, void *state, size_t *size) { (void)m; (void)state; *size = sizeof(Model); return 0; }
EXPORT int fmi2SerializeFMUstate(void *m, void *state, char bytes[], size_t size)
{
    (void)m;
    if (size < sizeof(Model)) return 3;
    memcpy(bytes, state, sizeof(Model));
    return 0;
}
EXPORT int fmi2DeSerializeFMUstate(void *m, const char bytes[], size_t size, void **state)
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
