/* Stepping and state of c_fmu.c. */

static void integrate(State *s, double duration) {
    long n = lround(ceil(duration / 1e-3 - 1e-9));
    double h;
    if (n < 1) n = 1;
    h = duration / (double)n;
    for (long i = 0; i < n; i++) {
        double x = s->x, v = s->v;
        double a1 = acceleration(s, x, v);
        double v2 = v + 0.5 * h * a1, a2 = acceleration(s, x + 0.5 * h * v, v2);
        double v3 = v + 0.5 * h * a2, a3 = acceleration(s, x + 0.5 * h * v2, v3);
        double v4 = v + h * a3, a4 = acceleration(s, x + h * v3, v4);
        s->x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4);
        s->v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    }
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set_state) {
    AT(step);
    Instance *self = c;
    (void)no_set_state;
#ifndef FAULT_step_before_init
    if (self->phase != STEPPING) return refuse(self, "fmi2DoStep must come after initialisation");
#endif
#ifdef FAULT_hang_negative_step
    if (step < 0.0) for (;;) usleep(1000);
#endif
#ifndef FAULT_negative_step
    if (!(step > 0.0)) return refuse(self, "communicationStepSize must be positive");
#else
    if (step < 0.0) step = -step;
#endif
    if (fabs(time - self->s.time) > 1e-9 * (1.0 + fabs(time))) return refuse(self, "wrong communication point");
#ifdef FAULT_crash_step
    if (self->s.steps == 5) { volatile int *nowhere = NULL; *nowhere = 1; }
#endif
#ifdef FAULT_exit_step
    if (self->s.steps == 5) exit(0);
#endif
#ifdef FAULT_hang_step
    if (self->s.steps == 5) for (;;) usleep(1000);
#endif
#ifdef FAULT_spin_step
    if (self->s.steps == 5) for (volatile long i = 0;; i++) { }
#endif
#ifdef FAULT_error_step
    if (self->s.steps == 5) return refuse(self, "solver failed");
#endif
#ifdef FAULT_logs_address
    if (self->s.steps == 5) {
        char text[80];
        snprintf(text, sizeof text, "<Slave object at %p> cannot go on", (void *)self);
        return refuse(self, text);
    }
#endif
#ifdef FAULT_logs_arguments
    if (self->s.steps == 5) {
        self->callbacks.logger(self->callbacks.componentEnvironment, self->name, fmi2Error, "logStatusError",
            "%s %d %i %#x %lld %-5s%.2f %c %g %d%% %d", "a", 7, -3, 31, 99999999999LL, "tank", 2.5, 'x', 1e-9, 50, 8);
        return fmi2Error;
    }
#endif
#ifdef FAULT_discard_step
    if (self->s.steps == 5) return fmi2Discard;
#endif
#ifdef FAULT_discard_first
    if (self->s.steps == 0) return fmi2Discard;
#endif
#ifdef FAULT_discard_long
    if (step > 6e-3) {
        integrate(&self->s, 5e-3);
        self->s.time += 5e-3;
        return fmi2Discard;
    }
#endif
#ifdef FAULT_fatal_step
    if (self->s.steps == 5) return fmi2Fatal;
#endif
#ifdef FAULT_logs_errors
    if (self->s.steps == 3) refuse(self, "no licence: demo mode");
#endif
#ifdef FAULT_pending_step
    return fmi2Pending;
#endif
#ifdef FAULT_illegal_status
    return (fmi2Status)17;
#endif
#ifdef FAULT_step_leak
    if (self->s.force == 0.0) {
        hoard = malloc(1 << 17);
        memset(hoard, 1, 1 << 17);
    }
#endif
#ifdef FAULT_eat_memory
    for (int i = 0; i < 64; i++) {
        hoard = malloc(1 << 26);
        if (!hoard) abort();
        memset(hoard, 1, 1 << 26);
    }
#endif
#ifdef FAULT_chatter
    for (int i = 0; self->s.steps == 0 && i < 20000; i++) puts("a slave that talks and talks and talks and talks and talks");
#endif
#ifdef FAULT_write_file
    FILE *file = self->s.steps ? NULL : fopen("left_behind.txt", "w");
    if (file) { fputs("a file nobody asked for\n", file); fclose(file); }
#endif
#ifdef FAULT_write_resources
    char path[1100];
    snprintf(path, sizeof path, "%s/left_behind.txt", self->resources);
    FILE *file = self->s.steps ? NULL : fopen(path, "w");
    if (file) { fputs("a file nobody asked for\n", file); fclose(file); }
#endif
#ifdef FAULT_forged_messages
    if (self->s.steps == 0) {
        static char deep[100001];
        const char *lines[] = {"[1]\n", "{\"rule\": []}\n", "{\"rule\": \"no.such\"}\n", "\xff\xfe\n", "7\n", "\n"};
        memset(deep, '[', 100000);
        deep[100000] = '\n';
        for (int fd = 3; fd < 8; fd++) {
            for (size_t i = 0; i < sizeof lines / sizeof *lines; i++)
                if (write(fd, lines[i], strlen(lines[i])) < 0) break;
            if (write(fd, deep, sizeof deep) < 0) continue;
        }
    }
#endif
#ifdef FAULT_orphan
    if (self->s.steps == 0 && fork() == 0) { sleep(60); _exit(0); }
#endif
#ifdef FAULT_shared_state
    if (self->s.force != 0.0) self->s.force = shared;
#endif
#ifdef FAULT_hidden_state
    if (self->s.force != 0.0) self->hidden += step;
    self->s.v += 0.5 * step * sin(7.0 * self->hidden);
#endif
#ifdef FAULT_variable_refused
    if (fabs(step - 0.01) > 1e-9) return refuse(self, "only steps of 0.01 s");
#endif
#if defined(FAULT_slow_physics)
    integrate(&self->s, 0.9 * step);
#elif defined(FAULT_ignores_step)
    integrate(&self->s, 0.01);
#else
    integrate(&self->s, step);
#endif
    self->s.time = time + (step > 0.0 ? step : 0.0);
#ifdef FAULT_undefined_symbol
    extern int nowhere_to_be_found(void);
    self->s.steps += nowhere_to_be_found();
#endif
#ifdef FAULT_python_symbols
    extern int Py_IsInitialized(void);
    if (step < 0.0) self->s.steps += Py_IsInitialized();
#endif
    self->s.steps++;
    self->s.moving = fabs(self->s.v) > 1e-3;
#ifdef FAULT_asynchronous
    return fmi2Pending;
#endif
#ifdef FAULT_ends_early
    if (self->s.steps > 50) return fmi2Discard;
#endif
#ifdef FAULT_warns
    return fmi2Warning;
#endif
    return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component c) { return refuse(c, "fmi2CancelStep: no step is pending"); }
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)kind; (void)value;
#ifdef FAULT_asynchronous
    static int polls = 0;
    *value = ++polls % 2 ? fmi2Pending : fmi2OK;
    return fmi2OK;
#endif
    return refuse(c, "fmi2GetStatus: no step is pending") == fmi2Error ? fmi2Discard : fmi2Error;
}
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = ((Instance *)c)->s.time;
    return fmi2OK;
}
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)c; (void)kind; (void)value;
    return fmi2Discard;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    (void)c; (void)kind; (void)value;
#ifdef FAULT_ends_early
    *value = kind == fmi2Terminated;
    return fmi2OK;
#endif
    return fmi2Discard;
}
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)c; (void)kind; (void)value;
    return fmi2Discard;
}
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
                                       const fmi2Real value[]) {
    (void)vr; (void)n; (void)order; (void)value;
    return refuse(c, "input derivatives are not supported");
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
                                        fmi2Real value[]) {
    State *s = &((Instance *)c)->s;
    double a = acceleration(s, s->x, s->v);
    for (size_t i = 0; i < n; i++) {
        if (order[i] != 1) return refuse(c, "output derivatives are of order 1");
        if (vr[i] == VR_X) value[i] = s->v;
        else if (vr[i] == VR_V) value[i] = a;
        else if (vr[i] == VR_ENERGY) value[i] = s->v * (s->mass * a + s->stiffness * s->x);
        else return refuse(c, "this variable has no output derivative");
#ifdef FAULT_slope_zero
        value[i] = 0.0;
#endif
    }
    return fmi2OK;
}
#ifndef FAULT_missing_function
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t nu,
                                        const fmi2ValueReference known[], size_t nk, const fmi2Real dv[], fmi2Real dz[]) {
    (void)c; (void)unknown; (void)known; (void)nk; (void)dv;
#ifdef FAULT_directional_refused
    return refuse(c, "directional derivatives are not supported");
#endif
    for (size_t i = 0; i < nu; i++) dz[i] = 0.0;  /* outputs follow the force after a step only */
    return fmi2OK;
}
#endif

typedef struct { State s; Phase phase; double start; } Saved;

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Instance *self = c;
#ifdef FAULT_state_refused
    return refuse(self, "states are not supported");
#endif
    Saved *saved = *state ? *state : malloc(sizeof(Saved));
    memset(saved, 0, sizeof *saved);
    saved->s = self->s;
    saved->phase = self->phase;
    saved->start = self->start;
    *state = saved;
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    Instance *self = c;
    const Saved *saved = state;
#ifdef FAULT_crash_restore
    volatile int *nowhere = NULL; *nowhere = 1;
#endif
#ifdef FAULT_state_not_restored
    double v = self->s.v;
#endif
    self->s = saved->s;
    self->phase = saved->phase;
    self->start = saved->start;
#ifdef FAULT_state_not_restored
    self->s.v = v;
#endif
#ifdef FAULT_state_rounded
    self->s.x = (float)self->s.x;
#endif
#ifdef FAULT_state_coarse
    self->s.x += 2e-4;
#endif
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c;
    if (!state || !*state) return fmi2OK;
#ifndef FAULT_state_not_nulled
    free(*state);
    *state = NULL;
#endif
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)c; (void)state;
    *size = sizeof(Saved);
#ifdef FAULT_serialised_empty
    *size = 0;
#endif
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    if (size < sizeof(Saved)) return refuse(c, "fmi2SerializeFMUstate: buffer too small");
    memcpy(bytes, state, sizeof(Saved));
#ifdef FAULT_serialised_incomplete
    ((Saved *)bytes)->s.x = 0.0;
#endif
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    if (size != sizeof(Saved)) return refuse(c, "fmi2DeSerializeFMUstate: wrong size");
#ifdef FAULT_deserialise_error
    return refuse(c, "cannot deserialise");
#endif
    Saved *saved = *state ? *state : malloc(sizeof(Saved));
    memcpy(saved, bytes, sizeof *saved);
    *state = saved;
    return fmi2OK;
}
