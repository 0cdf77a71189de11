enum { STATES = $states };

/* The outputs and the derivatives at the present time, inputs and states. */
static void peek(Data *data)
{
    ode_step($arguments);
}

static bool starts_at(double time) { return isfinite(time); }
