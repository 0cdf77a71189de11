static const double TICK = $tick;
static const double MOST_TICKS = $most;

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

static void refresh(Data *data) { (void)data; }

/* Ticks for a communication step, or -1 where it is not a whole number of them. */
static long ticks_in(double length)
{
    const double ticks = floor(length / TICK + 0.5);
    return ticks >= 1 && fabs(length / TICK - ticks) <= 1e-6 * ticks ? (long)ticks : -1;
}

static int run(Model *model, double now, double length)
{
    const long ticks = ticks_in(length);
    if (ticks < 0 || ticks > MOST_TICKS - *model->data.tick) return 3;
    for (long k = 0; k < ticks; ++k) advance(&model->data);
    model->data.time = now + length;
    model->stepped = true;
    return 0;
}
