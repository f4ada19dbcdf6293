/* The servo model of twin/servo as one writes it in C for one axis: P position loop, PI velocity loop, Stribeck friction by
   direction with exp of the C library, one linearly implicit second-order step a tick, a stop inside a step at its own time.

   `traces` is a constant where `run` is used, so each use is compiled as if the other were not there. */

#include <math.h>

typedef struct {
    double mass, newton_per_command, position_gain, velocity_gain, integral_gain, limit;
    double coulomb[2], fixed[2], inverse_stribeck[2], viscous[2]; /* moving in -, in + */
} axis;

static inline double clamped(double value, double limit) { return value > limit ? limit : value < -limit ? -limit : value; }

static inline void run(const axis *a, long ticks, double period, const double *reference, int traces, double *position_out,
                       double *torque_out, double *sums) {
    double position = reference[0], velocity = 0.0, integral = 0.0;
    double error_sum = 0.0, error_peak = 0.0, torque_sum = 0.0, torque_peak = 0.0;
    for (long tick = 0; tick < ticks; tick++) {
        double following = reference[tick] - position;
        double error = a->position_gain * following - velocity;
        integral = clamped(integral + a->integral_gain * error * period, a->limit);
        double torque = clamped(a->velocity_gain * error + integral, a->limit);
        if (traces) {
            position_out[tick] = position;
            torque_out[tick] = torque;
        } else {
            error_sum += following * following;
            torque_sum += torque * torque;
            if (fabs(following) > error_peak) error_peak = fabs(following);
            if (fabs(torque) > torque_peak) torque_peak = fabs(torque);
        }

        double force = a->newton_per_command * torque, push = force >= 0.0 ? 1.0 : -1.0;
        double excess = fabs(force) - a->fixed[force >= 0.0];
        if (velocity == 0.0 && excess <= 0.0) continue; /* it sticks */
        int side = velocity != 0.0 ? velocity > 0.0 : force >= 0.0;
        double direction = side ? 1.0 : -1.0, speed = velocity * direction;
        double ratio = speed * a->inverse_stribeck[side];
        double stribeck = (a->fixed[side] - a->coulomb[side]) * exp(-ratio * ratio);
        double friction = a->coulomb[side] + stribeck + a->viscous[side] * speed;
        double slope = a->viscous[side] - 2.0 * ratio * a->inverse_stribeck[side] * stribeck;
        double inertia = a->mass + 500.0 * period * slope;
        if (inertia < 0.5 * a->mass) inertia = 0.5 * a->mass;
        double acceleration = 1000.0 * (force - direction * friction) / inertia, next = velocity + period * acceleration;
        if (next * direction < 0.0) { /* it stops within the step, and may go on in the direction of the push */
            double stop = -velocity / acceleration, rest = period - stop;
            double on = excess > 0.0 ? push * excess * 1000.0 / inertia : 0.0;
            position += 0.5 * (velocity * stop + on * rest * rest);
            velocity = on * rest;
        } else {
            position += 0.5 * period * (velocity + next);
            velocity = next;
        }
    }
    if (!traces) {
        sums[0] = error_sum;
        sums[1] = error_peak;
        sums[2] = torque_sum;
        sums[3] = torque_peak;
    }
}

void with_traces(const axis *a, long ticks, double period, const double *reference, double *position, double *torque) {
    run(a, ticks, period, reference, 1, position, torque, 0);
}

void with_sums(const axis *a, long ticks, double period, const double *reference, double *sums) {
    run(a, ticks, period, reference, 0, 0, 0, sums);
}
