#include <stddef.h>
#include <stdlib.h>
#include <stdio.h>

typedef struct {
    double time;
$fields
} Data;

/* `stale`: whether the outputs are not yet those of the present time, inputs and state. */
typedef struct { Data data; bool stale; } Model;
static void peek(Data *data);

static void refresh(Model *model)
{
    if (model->stale) peek(&model->data);
    model->stale = false;
}

/* The first number that is not finite, named by its block, or NULL. */
static const char *fault_of(const Data *data)
{
$faults
    return NULL;
}

enum { STOPS = $stops };

/* A model and who is told of what is wrong, which is no part of its state. */
typedef struct { Model model; void *environment; void (*log)(void); char name[128]; bool told; } Instance;
static void tell(Instance *instance, int status, const char *message);

/* The status after the outputs or the slopes were computed: 3, an error, where a number is not finite. */
static int soundness(Model *model)
{
    Instance *instance = (Instance *)model;
    const char *fault = fault_of(&model->data);
    if (!fault) return 0;
    if (!instance->told) tell(instance, STOPS ? 3 : 1, fault);
    instance->told = !STOPS;
    return STOPS ? 3 : 0;
}

enum { REAL, INTEGER, TRUTH, TIME };
typedef struct { int kind; size_t offset; int count; bool input; } Variable;
static const Variable VARIABLES[] = {
$variables
};
enum { COUNT = sizeof VARIABLES / sizeof VARIABLES[0] };
static void begin(Model *model)
{
    Data *data = &model->data;
    memset(model, 0, sizeof *model);
    model->stale = true;
$start
}

static double get_element(const Data *data, const Variable *variable, int i)
{
    const char *place = (const char *)data + variable->offset;
    switch (variable->kind) {
    case REAL: return ((const $real *)place)[i];
    case INTEGER: return ((const int32_t *)place)[i];
    case TRUTH: return ((const bool *)place)[i];
    default: return data->time;
    }
}

static void set_element(Data *data, const Variable *variable, int i, double value)
{
    char *place = (char *)data + variable->offset;
    switch (variable->kind) {
    case REAL: (($real *)place)[i] = ($real)value; break;
    case INTEGER: ((int32_t *)place)[i] = (int32_t)value; break;
    default: ((bool *)place)[i] = value != 0; break;
    }
}

static bool right(const Variable *variable, int kind) { return variable->kind == kind || (kind == REAL && variable->kind == TIME); }
