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
static void begin(Data *data)
{
    memset(data, 0, sizeof *data);
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
