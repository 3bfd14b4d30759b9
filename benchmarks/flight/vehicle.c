/* The 12-state model of autonomy/vehicle/kernel.py and its Runge-Kutta step in plain C. */
#include <math.h>
#include <string.h>

enum {
    MASS_1, MASS_2, MASS_3, INERTIA_1, INERTIA_2, INERTIA_3,
    SLIDING_MASS, OFFSET_MASS, OFFSET_MASS_DEPTH, GRAVITY, WATER_DENSITY, AREA,
    DRAG_0, DRAG_ALPHA, DRAG_DELTA, SIDE_BETA, SIDE_DELTA, LIFT_0, LIFT_ALPHA,
    ROLL_BETA, ROLL_DAMPING, PITCH_0, PITCH_ALPHA, PITCH_DAMPING,
    YAW_BETA, YAW_DAMPING, YAW_DELTA
};

static const double COS_PITCH_FLOOR = 0.02;

static void wrench(const double *x, double delta, const double *p, double *f)
{
    double v1 = x[6], v2 = x[7], v3 = x[8];
    double across = sqrt(v1 * v1 + v3 * v3);
    double speed = sqrt(v1 * v1 + v2 * v2 + v3 * v3);
    if (speed == 0.0) {
        memset(f, 0, 6 * sizeof *f);
        return;
    }
    double ca = across > 0.0 ? v1 / across : 1.0, sa = across > 0.0 ? v3 / across : 0.0;
    double cb = across / speed, sb = v2 / speed;
    double alpha = atan2(v3, v1), beta = atan2(v2, across);
    double q = 0.5 * p[WATER_DENSITY] * speed * speed * p[AREA];
    double drag = q * (p[DRAG_0] + p[DRAG_ALPHA] * alpha * alpha + p[DRAG_DELTA] * delta * delta);
    double side = q * (p[SIDE_BETA] * beta + p[SIDE_DELTA] * delta);
    double lift = q * (p[LIFT_0] + p[LIFT_ALPHA] * alpha);
    double roll = q * (p[ROLL_BETA] * beta + p[ROLL_DAMPING] * x[9]);
    double pitch = q * (p[PITCH_0] + p[PITCH_ALPHA] * alpha + p[PITCH_DAMPING] * x[10]);
    double yaw = q * (p[YAW_BETA] * beta + p[YAW_DAMPING] * x[11] + p[YAW_DELTA] * delta);
    f[0] = -ca * cb * drag - ca * sb * side + sa * lift;
    f[1] = -sb * drag + cb * side;
    f[2] = -sa * cb * drag - sa * sb * side - ca * lift;
    f[3] = ca * cb * roll - ca * sb * pitch - sa * yaw;
    f[4] = sb * roll + cb * pitch;
    f[5] = sa * cb * roll - sa * sb * pitch + ca * yaw;
}

static void derivative(const double *x, const double *u, const double *p, double *out)
{
    double f[6];
    wrench(x, u[2], p, f);
    double sf = sin(x[3]), cf = cos(x[3]), st = sin(x[4]), ct = cos(x[4]);
    double sp = sin(x[5]), cp = cos(x[5]);
    double v1 = x[6], v2 = x[7], v3 = x[8], w1 = x[9], w2 = x[10], w3 = x[11];
    double m1 = p[MASS_1], m2 = p[MASS_2], m3 = p[MASS_3];
    double j1 = p[INERTIA_1], j2 = p[INERTIA_2], j3 = p[INERTIA_3];
    out[0] = ct * cp * v1 + (cp * st * sf - cf * sp) * v2 + (sf * sp + cf * cp * st) * v3;
    out[1] = ct * sp * v1 + (cf * cp + st * sf * sp) * v2 + (cf * st * sp - cp * sf) * v3;
    out[2] = -st * v1 + ct * sf * v2 + ct * cf * v3;
    double safe = fabs(ct) >= COS_PITCH_FLOOR ? ct : copysign(COS_PITCH_FLOOR, ct);
    double turn = (sf * w2 + cf * w3) / safe;
    out[3] = w1 + st * turn;
    out[4] = cf * w2 - sf * w3;
    out[5] = turn;
    double weight = u[0] * p[GRAVITY];
    out[6] = (m2 * v2 * w3 - m3 * v3 * w2 - weight * st + f[0]) / m1;
    out[7] = (m3 * v3 * w1 - m1 * v1 * w3 + weight * ct * sf + f[1]) / m2;
    out[8] = (m1 * v1 * w2 - m2 * v2 * w1 + weight * ct * cf + f[2]) / m3;
    double hang = p[OFFSET_MASS] * p[GRAVITY] * p[OFFSET_MASS_DEPTH];
    double tilt = p[SLIDING_MASS] * p[GRAVITY] * u[1];
    out[9] = ((j2 - j3) * w2 * w3 + (m2 - m3) * v2 * v3 + f[3] - hang * ct * sf) / j1;
    out[10] = ((j3 - j1) * w3 * w1 + (m3 - m1) * v3 * v1 + f[4] - hang * st - tilt * ct * cf) / j2;
    out[11] = ((j1 - j2) * w1 * w2 + (m1 - m2) * v1 * v2 + f[5] + tilt * ct * sf) / j3;
}

void rk4_steps(double *x, const double *u, const double *p, double dt, long steps)
{
    double slope[12], total[12], probe[12];
    for (long n = 0; n < steps; n++) {
        derivative(x, u, p, total);
        for (int i = 0; i < 12; i++) probe[i] = x[i] + 0.5 * dt * total[i];
        derivative(probe, u, p, slope);
        for (int i = 0; i < 12; i++) {
            total[i] += 2.0 * slope[i];
            probe[i] = x[i] + 0.5 * dt * slope[i];
        }
        derivative(probe, u, p, slope);
        for (int i = 0; i < 12; i++) {
            total[i] += 2.0 * slope[i];
            probe[i] = x[i] + dt * slope[i];
        }
        derivative(probe, u, p, slope);
        for (int i = 0; i < 12; i++) x[i] += dt / 6.0 * (total[i] + slope[i]);
    }
}
