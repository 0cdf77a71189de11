static const double TICK = $tick;
static const double MOST_TICKS = $most;

static void advance(Data *data)
{
    tick_step($arguments);
}

/* The outputs at the present time: those of the tick that comes next, before it is made. */
static void peek(Data *data)
{
    tick_outputs($shown);
}

/* The ticks are counted from 0 s, and what depends on time goes by them. */
static bool starts_at(double time) { return time == 0; }

/* Ticks for a communication step, or -1 where it is not a whole number of them. */
static long ticks_in(double length)
{
    const double ticks = floor(length / TICK + 0.5);
    return ticks >= 1 && fabs(length / TICK - ticks) <= 1e-6 * ticks ? (long)ticks : -1;
}

static int run(Model *model, double now, double length)
{
    const long ticks = ticks_in(length);
    if (fabs(now - model->data.time) > 1e-6 * (TICK + fabs(now))) return 3;
    if (ticks < 0 || ticks > MOST_TICKS - *model->data.tick) return 3;
    for (long k = 0; k < ticks; ++k) {
        advance(&model->data);
        model->data.time = now + (k + 1) * TICK;
        model->stale = true;
        if (soundness(model)) return 3;
    }
    model->data.time = now + length;
    refresh(model);
    return soundness(model);
}
