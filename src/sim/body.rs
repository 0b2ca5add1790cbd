use crate::math::sin_cos;

/// Gravity in m/s².
const GRAVITY: f32 = 9.81;
/// How stiffly a wheel holds to the ground, N for each m/s of slip, before [`Body::grip`] smooths it.
const STIFFNESS: f32 = 20_000.0;

/// Four mecanum wheels under a rigid body: what the ground does to wheels and body.
///
/// The rollers touch the floor in an O. In the order front left, front right, rear left, rear right, the ground
/// passes under wheel `i` at `u_i = vx + Y_i vy + W_i L wz`, and a force `F_i` along the wheel acts on the body by the
/// transposed of that, so that no energy comes from nowhere.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Body {
    wheel_radius: f32,
    /// Half wheelbase and half track, m.
    lever: f32,
    mass: f32,
    yaw_inertia: f32,
    /// The largest force of one wheel along its direction, N.
    traction: f32,
    /// Velocity in the world, m/s and rad/s.
    vx: f32,
    vy: f32,
    wz: f32,
    /// In `f64`: many small steps over a long way.
    x: f64,
    y: f64,
    heading: f64,
    /// A push from outside, in the world, N and Nm.
    pub(crate) push: [f32; 3],
}

/// The signs of vy and of wz in the speed of the ground under each wheel.
const SIGNS: [(f32, f32); 4] = [(-1.0, -1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)];

/// Velocities of a body, in its own frame or the world's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Velocity {
    pub(crate) vx: f32,
    pub(crate) vy: f32,
    pub(crate) wz: f32,
}

impl Body {
    pub(crate) const fn new(
        wheel_radius: f32,
        lever: f32,
        mass: f32,
        yaw_inertia: f32,
        friction: f32,
    ) -> Self {
        Self {
            wheel_radius,
            lever,
            mass,
            yaw_inertia,
            // A roller holds along its axis only, at 45 degrees to the wheel.
            traction: friction * mass * GRAVITY / 4.0 * core::f32::consts::FRAC_1_SQRT_2,
            vx: 0.0,
            vy: 0.0,
            wz: 0.0,
            x: 0.0,
            y: 0.0,
            heading: 0.0,
            push: [0.0; 3],
        }
    }

    /// Moves the body by one step of `dt_s`; turns wheel speeds into the torques by which the ground holds the
    /// wheels. `wheels` are rad/s forward and the inertia at the wheel, kg m².
    pub(crate) fn step(&mut self, wheels: [(f32, f32); 4], dt_s: f32) -> [f32; 4] {
        let (sine, cosine) = sin_cos(self.heading_wrapped());
        let Velocity { vx, vy, wz } = self.velocity_body();
        let mut force = [self.push[0], self.push[1], self.push[2]];
        let mut torques = [0.0; 4];
        let mut body_force = (0.0, 0.0);
        for (((speed, inertia), (along_y, about_z)), torque) in
            wheels.into_iter().zip(SIGNS).zip(&mut torques)
        {
            let ground = vx + along_y * vy + about_z * self.lever * wz;
            let slip = self.wheel_radius * speed - ground;
            let held = (slip * self.grip(inertia, dt_s)).clamp(-self.traction, self.traction);
            *torque = -held * self.wheel_radius;
            body_force.0 += held;
            body_force.1 += along_y * held;
            force[2] += about_z * self.lever * held;
        }
        force[0] += cosine * body_force.0 - sine * body_force.1;
        force[1] += sine * body_force.0 + cosine * body_force.1;
        self.vx += force[0] / self.mass * dt_s;
        self.vy += force[1] / self.mass * dt_s;
        self.wz += force[2] / self.yaw_inertia * dt_s;
        self.x += f64::from(self.vx * dt_s);
        self.y += f64::from(self.vy * dt_s);
        self.heading += f64::from(self.wz * dt_s);
        torques
    }

    /// Returns the force for a slip of 1 m/s, over a whole step: the slip dies out within it and never turns
    /// around, however stiff the contact (an implicit step with all four wheels at once, bounded from above).
    fn grip(&self, inertia: f32, dt_s: f32) -> f32 {
        let body = (4.0 / self.mass).max(4.0 * self.lever * self.lever / self.yaw_inertia);
        let compliance = self.wheel_radius * self.wheel_radius / inertia + body;
        STIFFNESS / (1.0 + STIFFNESS * compliance * dt_s)
    }

    #[expect(clippy::cast_possible_truncation, reason = "within a turn")]
    fn heading_wrapped(&self) -> f32 {
        const TURN: f64 = core::f64::consts::TAU;
        let turns = (self.heading / TURN) as i64;
        (self.heading - turns as f64 * TURN) as f32
    }

    /// Returns the velocity in the body's frame.
    pub(crate) fn velocity_body(&self) -> Velocity {
        let (sine, cosine) = sin_cos(self.heading_wrapped());
        Velocity {
            vx: cosine * self.vx + sine * self.vy,
            vy: cosine * self.vy - sine * self.vx,
            wz: self.wz,
        }
    }

    /// Returns the place in the world, in m, and the heading in rad, not reduced to one turn.
    pub(crate) const fn pose(&self) -> (f64, f64, f64) {
        (self.x, self.y, self.heading)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: f32 = 1e-4;
    const RADIUS: f32 = 0.076;
    const INERTIA: f32 = 8e-3;

    fn body() -> Body {
        Body::new(RADIUS, 0.38, 20.0, 0.8, 0.8)
    }

    /// Four free wheels, each with a torque, under the body.
    fn run(body: &mut Body, wheels: &mut [f32; 4], torques: [f32; 4], steps: u32) {
        for _ in 0..steps {
            let ground = body.step(wheels.map(|speed| (speed, INERTIA)), STEP);
            for ((speed, torque), ground) in wheels.iter_mut().zip(torques).zip(ground) {
                *speed += (torque + ground) * STEP / INERTIA;
            }
        }
    }

    fn kinetic(body: &Body, wheels: &[f32; 4]) -> f32 {
        let turning: f32 = wheels.iter().map(|speed| INERTIA * speed * speed).sum();
        let moving = 20.0 * (body.vx * body.vx + body.vy * body.vy) + 0.8 * body.wz * body.wz;
        0.5 * (turning + moving)
    }

    #[test]
    fn equal_torques_drive_forward_with_the_inertia_of_body_and_wheels() {
        let (mut body, mut wheels) = (body(), [0.0; 4]);
        run(&mut body, &mut wheels, [1.0; 4], 5_000);
        let mass = 20.0 + 4.0 * INERTIA / (RADIUS * RADIUS);
        let expected = 4.0 / RADIUS / mass * 0.5;
        let Velocity { vx, vy, wz } = body.velocity_body();
        assert!((vx / expected - 1.0).abs() < 0.01, "{vx} and not {expected}");
        assert!(vy.abs() < 1e-4 && wz.abs() < 1e-4);
        let (x, y, _) = body.pose();
        assert!((x / (0.5 * 0.5 * f64::from(expected)) - 1.0).abs() < 0.01 && y.abs() < 1e-3);
    }

    #[test]
    fn the_pattern_of_the_wheels_gives_its_direction() {
        let strafe_left = [-1.0, 1.0, 1.0, -1.0];
        let turn_left = [-1.0, 1.0, -1.0, 1.0];
        for (torques, direction) in
            [(strafe_left, (0, 1, 0)), (turn_left, (0, 0, 1)), ([-1.0; 4], (-1, 0, 0))]
        {
            let (mut body, mut wheels) = (body(), [0.0; 4]);
            run(&mut body, &mut wheels, torques, 1_000);
            let Velocity { vx, vy, wz } = body.velocity_body();
            let sign = |v: f32| {
                if v > 0.05 {
                    1
                } else if v < -0.05 {
                    -1
                } else {
                    0
                }
            };
            assert_eq!((sign(vx), sign(vy), sign(wz)), direction);
        }
    }

    #[test]
    fn rolling_without_torque_keeps_its_energy_but_for_slip() {
        let (mut body, mut wheels) = (body(), [0.0; 4]);
        run(&mut body, &mut wheels, [0.5, 0.9, 0.7, 1.1], 3_000);
        run(&mut body, &mut wheels, [0.0; 4], 500); // the slip dies out
        let before = kinetic(&body, &wheels);
        run(&mut body, &mut wheels, [0.0; 4], 100_000);
        let after = kinetic(&body, &wheels);
        assert!(after <= before * 1.0001 && after > 0.98 * before, "{before} J, {after} J");
    }

    #[test]
    fn wheels_spin_when_the_torque_is_more_than_the_ground_holds() {
        let (mut body, mut wheels) = (body(), [0.0; 4]);
        run(&mut body, &mut wheels, [6.0; 4], 2_000);
        let acceleration = body.velocity_body().vx / 0.2;
        // friction 0.8 of gravity, along rollers at 45 degrees
        assert!(
            (acceleration - 0.8 * 9.81 * core::f32::consts::FRAC_1_SQRT_2).abs() < 0.01,
            "{acceleration} m/s2"
        );
        assert!(wheels[0] * RADIUS > 2.0 * body.velocity_body().vx);
    }

    #[test]
    fn locked_wheels_hold_the_body_against_a_push() {
        let mut body = body();
        body.push = [20.0, -20.0, 2.0];
        for _ in 0..10_000 {
            let _torques = body.step([(0.0, INERTIA); 4], STEP);
        }
        let (x, y, heading) = body.pose();
        assert!(x.abs() < 0.01 && y.abs() < 0.01 && heading.abs() < 0.05, "{x} {y} {heading}");
    }

    #[test]
    fn velocity_in_the_body_turns_with_the_heading() {
        let mut body = body();
        body.vx = 1.0;
        body.heading = core::f64::consts::FRAC_PI_2 + 100.0 * core::f64::consts::TAU;
        let Velocity { vx, vy, .. } = body.velocity_body();
        assert!(vx.abs() < 1e-5 && (vy + 1.0).abs() < 1e-5);
    }
}
