enum { STATES = $states };

/* The outputs and the derivatives at the present time, inputs and states. */
static void peek(Data *data)
{
    ode_step($arguments);
}

static void refresh(Data *data) { peek(data); }
