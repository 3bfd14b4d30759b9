"""Readable equations of motion in matrix form; ``autonomy.vehicle.kernel`` is the fast twin.

State: position NED m, Euler angles (roll, pitch, heading) rad, velocity through the water in body
axes m/s, angular velocity in body axes rad/s; the extended model adds net mass kg, position of the
sliding mass m and tail angle rad.

Where the thesis is ambiguous: the sliding mass lies on the forward axis (section 5.3, not 3.1),
the inertia is constant, the angle of attack is ``atan2(v3, v1)``, and the tail's force is the
reaction to its acceleration, because the printed force has no mean over a flap.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.frames import rotation_ned_from_body
from autonomy.vehicle.config import Vehicle, VehicleParameters
from autonomy.vehicle.hull import Hull
from autonomy.vehicle.surroundings import Surroundings
from autonomy.vehicle.water import Flow, WaterColumn

COS_PITCH_FLOOR = 0.02
"""Smallest cosine of pitch in the Euler rates, which are singular at 90 degrees."""


def euler_rate_matrix(roll: float, pitch: float) -> FloatArray:
    """Matrix from angular velocity to rates of roll, pitch and heading (R_omega of Eq. 3.2)."""
    sf, cf = math.sin(roll), math.cos(roll)
    st, ct = math.sin(pitch), math.cos(pitch)
    ct = math.copysign(max(abs(ct), COS_PITCH_FLOOR), ct)
    return np.array([[1.0, st / ct * sf, st / ct * cf], [0.0, cf, -sf], [0.0, sf / ct, cf / ct]])


def flow_angles(velocity: FloatArray) -> tuple[float, float]:
    """Angle of attack and sideslip angle of a velocity in body axes; 0 at rest."""
    v1, v2, v3 = velocity
    return math.atan2(v3, v1), math.atan2(v2, math.hypot(v1, v3))


def flow_rotation(alpha: float, beta: float) -> FloatArray:
    """Matrix from the flow's frame to body axes, R_bv of Eq. 3.3; maps [V, 0, 0] to v_b."""
    sa, ca = math.sin(alpha), math.cos(alpha)
    sb, cb = math.sin(beta), math.cos(beta)
    return np.array([[ca * cb, -ca * sb, -sa], [sb, cb, 0.0], [sa * cb, -sa * sb, ca]])


def hydrodynamic_wrench(
    velocity: FloatArray,
    angular_velocity: FloatArray,
    delta: float,
    p: VehicleParameters,
    *,
    extended: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Force N and moment N m of the water in body axes.

    Args:
        velocity: Through the water, shape ``(3,)``, m/s.
        angular_velocity: Shape ``(3,)``, rad/s.
        delta: Tail angle, rad.
        p: Parameters.
        extended: Whether lift falls off with cos(alpha) and the pitch moment goes with
            sin(2 alpha), as in Eq. 5.18; otherwise Eq. 3.4.
    """
    alpha, beta = flow_angles(velocity)
    w1, w2, w3 = angular_velocity
    q = 0.5 * p.water_density_kg_m3 * float(velocity @ velocity) * p.area_m2
    drag = q * (p.drag_0 + p.drag_alpha * alpha**2 + p.drag_delta * delta**2)
    side = q * (p.side_beta * beta + p.side_delta * delta)
    lift = q * (p.lift_0 + p.lift_alpha * alpha) * (math.cos(alpha) if extended else 1.0)
    pitch_alpha = 0.5 * math.sin(2.0 * alpha) if extended else alpha
    roll = q * (p.roll_beta_m * beta + p.roll_damping_m_s * w1)
    pitch = q * (p.pitch_0_m + p.pitch_alpha_m * pitch_alpha + p.pitch_damping_m_s * w2)
    yaw = q * (p.yaw_beta_m * beta + p.yaw_damping_m_s * w3 + p.yaw_delta_m * delta)
    to_body = flow_rotation(alpha, beta)
    return to_body @ [-drag, side, -lift], to_body @ [roll, pitch, yaw]


def rigid_body_rates(
    state: FloatArray,
    m0: float,
    rp1: float,
    force: FloatArray,
    moment: FloatArray,
    p: VehicleParameters,
) -> FloatArray:
    """Rates of the first 12 states under an outer force and moment in body axes (Eq. 3.2)."""
    roll, pitch, heading = state[3:6]
    v, w = state[6:9], state[9:12]
    mass = np.array([p.mass_1_kg, p.mass_2_kg, p.mass_3_kg])
    inertia = np.array([p.inertia_1_kg_m2, p.inertia_2_kg_m2, p.inertia_3_kg_m2])
    rotation = rotation_ned_from_body(roll, pitch, heading)
    down = rotation[2]  # the NED down axis in body components
    offset = np.array([0.0, 0.0, p.offset_mass_depth_m])
    sliding = np.array([rp1, 0.0, 0.0])
    g = p.gravity_m_s2
    v_rate = (np.cross(mass * v, w) + m0 * g * down + force) / mass
    w_rate = (
        np.cross(inertia * w, w)
        + np.cross(mass * v, v)
        + moment
        + p.offset_mass_kg * g * np.cross(offset, down)
        + p.sliding_mass_kg * g * np.cross(sliding, down)
    ) / inertia
    return np.concatenate([rotation @ v, euler_rate_matrix(roll, pitch) @ w, v_rate, w_rate])


def state_derivative(
    state: FloatArray, inputs: FloatArray, parameters: VehicleParameters
) -> FloatArray:
    """Rates of the 12-state model, shape ``(12,)``.

    Args:
        state: Shape ``(12,)``.
        inputs: Net mass kg, sliding mass m, tail angle rad.
        parameters: The vehicle's model.

    Source:
        Thesis Eq. 3.2 to 3.4.
    """
    m0, rp1, delta = inputs
    force, moment = hydrodynamic_wrench(state[6:9], state[9:12], delta, parameters)
    return rigid_body_rates(state, m0, rp1, force, moment, parameters)


def wave_surface(
    position: FloatArray, velocity_ned: FloatArray, surroundings: Surroundings, time_s: float
) -> tuple[float, float]:
    """Depth of the wavy surface at a robot, m, and its rate as the robot meets it, m/s."""
    level, level_rate = 0.0, 0.0
    for wave in surroundings.waves:
        slope, rise = wave.elevation_slope(position, time_s)
        level -= wave.elevation_m(position, time_s)
        level_rate -= rise + float(slope @ velocity_ned[:2])
    return level, level_rate


def contact_force(
    position: FloatArray,
    velocity_ned: FloatArray,
    surroundings: Surroundings,
    p: VehicleParameters,
    time_s: float = 0.0,
) -> FloatArray:
    """Force N of surface, floor and walls in NED: springs with dampers that never pull."""
    s = surroundings
    level, level_rate = wave_surface(position, velocity_ned, s, time_s)
    low = np.array([s.x_min_m, s.y_min_m, level])
    high = np.array([s.x_max_m, s.y_max_m, s.floor_m])
    if not s.has_walls:
        low[:2], high[:2] = -math.inf, math.inf
    k, c = p.contact_stiffness_n_m, p.contact_damping_n_s_m
    towards_surface = velocity_ned - [0.0, 0.0, level_rate]
    too_low = np.maximum(k * (low - position) - c * towards_surface, 0.0)
    too_high = np.maximum(k * (position - high) + c * velocity_ned, 0.0)
    return np.where(position < low, too_low, 0.0) - np.where(position > high, too_high, 0.0)


def tail_rate(delta: float, target: float, vehicle: Vehicle) -> float:
    """Rate of the tail: first order (Eq. 5.17) within the servo's greatest rate."""
    greatest = vehicle.limits.delta_rate_rad_s
    wanted = vehicle.parameters.tail_response_per_s * (target - delta)
    return min(max(wanted, -greatest), greatest)


def net_mass(m0: float, depth_m: float, hull: Hull, column: WaterColumn | None) -> float:
    """What weighs on the robot at a depth, kg: denser water lifts it, a pressed hull lets it sink.

    Args:
        m0: Net mass where the robot was ballasted.
        depth_m: Depth.
        hull: What it displaces, and how it gives.
        column: Density over depth.
    """
    displaced = 1.0 - hull.compressibility_per_m * max(depth_m, 0.0)
    if column is not None:
        displaced *= column.density_at(depth_m) / column.ballast_kg_m3
    return m0 - hull.displaced_mass_kg * (displaced - 1.0)


def flow_acceleration(
    velocity_ned: FloatArray, m0: float, flow: Flow, mass: FloatArray, rotation: FloatArray
) -> FloatArray:
    """What moving water adds to the rate of the velocity through the water, body axes, m/s2.

    The velocity is measured in the water, which accelerates. Along the robot's path the water's
    velocity changes by ``a + (v . grad) u``, with ``a`` the acceleration of a water particle and
    ``v`` the robot's velocity through the water; so much the robot seems to lose. But the pressure
    that accelerates the water pushes the robot too, by the mass that it displaces, and so does
    the added mass; of ``a`` there remains what the net mass lacks:
    ``-(v . grad) u - (m0 / m) a``. A neutral robot is carried by the waves like the water, and one
    that sinks through a sheared current keeps its momentum over ground.

    Left out: that the water turns and differs along the hull, which is short beside the scale of
    currents and waves.

    Args:
        velocity_ned: Through the water, NED, shape ``(3,)``.
        m0: Net mass, kg.
        flow: The water's motion.
        mass: With added mass along the body axes, shape ``(3,)``.
        rotation: From body axes to NED.
    """
    met = rotation.T @ (flow.gradient_per_s @ velocity_ned)
    return -met - m0 / mass * (rotation.T @ flow.acceleration_m_s2)


def extended_state_derivative(
    state: FloatArray,
    actuator: FloatArray,
    vehicle: Vehicle,
    surroundings: Surroundings,
    time_s: float = 0.0,
) -> FloatArray:
    """Rates of the 15-state model, shape ``(15,)``.

    Args:
        state: Shape ``(15,)``.
        actuator: Rate of the net mass kg/s, of the sliding mass m/s, reference of the tail rad,
            acceleration of the tail's flap rad/s2.
        vehicle: The robot.
        surroundings: Water and borders.
        time_s: Time, which the waves depend on.

    Source:
        Thesis Eq. 5.17 and 5.18, with ``F_tail = -(Ct / k_delta^2) delta''`` of the flap alone:
        a tail without mass jumps to a new rate when its reference steps, so the impulse of a
        steering step is not in ``delta''``, and half of it would push the wrong way. Cross-flow
        drag of turning at rest, contact and all of the surroundings are additions.
    """
    p = vehicle.parameters
    m0, rp1, delta = state[12:15]
    w = state[9:12]
    water = p.water_density_kg_m3 * p.tail_area_m2 * p.tail_water_length_m
    thrust = -water * p.tail_centre_m * actuator[3]
    force, moment = hydrodynamic_wrench(state[6:9], w, delta, p, extended=True)
    crossflow = np.array([p.crossflow_1_n_m_s2, p.crossflow_2_n_m_s2, p.crossflow_3_n_m_s2])
    moment = moment - crossflow * np.abs(w) * w
    moment[2] += p.tail_arm_m * thrust * math.cos(delta)
    force = force + np.array([thrust * math.sin(delta), 0.0, 0.0])
    column = surroundings.column
    density = 1.0 if column is None else column.density_at(state[2]) / p.water_density_kg_m3
    force, moment = density * force, density * moment
    m0 = net_mass(m0, state[2], vehicle.hull, column)
    rotation = rotation_ned_from_body(*state[3:6])
    flow = surroundings.flow(state[:3], time_s)
    through_water = rotation @ state[6:9]
    velocity_ned = through_water + flow.velocity_m_s
    contact = contact_force(state[:3], velocity_ned, surroundings, p, time_s)
    rates = rigid_body_rates(state, m0, rp1, force + rotation.T @ contact, moment, p)
    rates[:3] = velocity_ned
    mass = np.array([p.mass_1_kg, p.mass_2_kg, p.mass_3_kg])
    rates[6:9] += flow_acceleration(through_water, m0, flow, mass, rotation)
    if state[2] < wave_surface(state[:3], velocity_ned, surroundings, time_s)[0]:
        rates[9:11] -= p.surface_damping_per_s * w[:2]
    return np.concatenate(
        [rates, [actuator[0], actuator[1], tail_rate(delta, actuator[2], vehicle)]]
    )


def electrical_power(actuator_rates: FloatArray, vehicle: Vehicle) -> float:
    """Electrical power, W, at rates of net mass kg/s, sliding mass m/s and tail rad/s (Eq. 5.20).

    Its integral is the sixteenth state of ``extended_kernel.advance``.
    """
    m0_rate, rp1_rate, tail_rate_rad_s = (float(rate) for rate in actuator_rates)
    return vehicle.energy.power_w(vehicle.limits, m0_rate, rp1_rate, tail_rate_rad_s)
