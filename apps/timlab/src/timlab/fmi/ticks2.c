EXPORT int fmi2DoStep(void *m, double now, double length, int keep) { (void)keep; return run(m, now, length); }
EXPORT int fmi2CancelStep(void *m) { (void)m; return 3; }
