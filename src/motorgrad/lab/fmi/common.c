#include <stddef.h>
#include <stdlib.h>

typedef struct {
    double time;
$fields
} Data;

typedef struct { Data data; double start; bool stepped; } Model;

enum { REAL, INTEGER, TRUTH, TIME };
typedef struct { int kind; size_t offset; int count; bool input; } Variable;
static const Variable VARIABLES[] = {
$variables
};
enum { COUNT = sizeof VARIABLES / sizeof VARIABLES[0] };
static const double TICK = $tick;

static void begin(Data *data)
{
    memset(data, 0, sizeof *data);
$start
}

static void advance(Data *data)
{
    tick_step($arguments);
}

/* The outputs of the present tick, which change with the inputs; the state stays. */
static void peek(Data *data)
{
    Data after = *data;
    advance(&after);
$peeked
}

static double get_element(const Data *data, const Variable *variable, int i)
{
    const char *place = (const char *)data + variable->offset;
    switch (variable->kind) {
    case REAL: return ((const float *)place)[i];
    case INTEGER: return ((const int32_t *)place)[i];
    case TRUTH: return ((const bool *)place)[i];
    default: return data->time;
    }
}

static void set_element(Data *data, const Variable *variable, int i, double value)
{
    char *place = (char *)data + variable->offset;
    switch (variable->kind) {
    case REAL: ((float *)place)[i] = (float)value; break;
    case INTEGER: ((int32_t *)place)[i] = (int32_t)value; break;
    default: ((bool *)place)[i] = value != 0; break;
    }
}

/* Ticks for a communication step, or -1 where it is not a whole number of them. */
static long ticks_in(double length)
{
    const double ticks = floor(length / TICK + 0.5);
    return ticks >= 1 && fabs(length / TICK - ticks) <= 1e-6 * ticks ? (long)ticks : -1;
}

static int run(Model *model, double now, double length)
{
    const long ticks = ticks_in(length);
    if (ticks < 0) return 3;
    for (long k = 0; k < ticks; ++k) advance(&model->data);
    model->data.time = now + length;
    model->stepped = true;
    return 0;
}

static bool right(const Variable *variable, int kind) { return variable->kind == kind || (kind == REAL && variable->kind == TIME); }
