use crate::geometry::Vec2;
use crate::math::{sin_cos, sqrt};

/// Gravity in m/s².
const GRAVITY: f32 = 9.81;
/// Stiffness of a wheel on the ground, N for each m/s of slip, before [`held`] smooths it.
const STIFFNESS: f32 = 40_000.0;

/// A rigid body on wheels: the action of the ground on both.
///
/// The ground passes under a wheel at `p` with `u = v + wz x p`. The ground holds the wheel along the direction of its
/// [`Contact`], and a tyre across this direction too, against the slip, with friction times load at most. The force
/// acts on the body at the place of the wheel, and on the wheel with the lever of its slip, so energy is conserved.
/// There is one rule for all layouts, and no matrix of any.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Body {
    mass: f32,
    yaw_inertia: f32,
    /// The largest force of one wheel, N.
    traction: f32,
    /// By how much 1 N on every contact moves the softest of them, 1/kg: bounded from above.
    compliance: f32,
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

/// Where and how a wheel holds the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Contact {
    /// From the centre of mass, m.
    pub(crate) position: Vec2,
    /// Direction of the pull of a turning wheel, of length 1.
    pub(crate) along: Vec2,
    /// Speed over the ground in this direction at 1 rad/s, m.
    pub(crate) reach: f32,
    /// Whether the ground holds the wheel across this direction too.
    pub(crate) holds_across: bool,
}

/// A wheel in one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rolling {
    pub(crate) contact: Contact,
    /// rad/s, positive forward.
    pub(crate) velocity: f32,
    /// kg m², at the wheel.
    pub(crate) inertia: f32,
    /// Nm, by which the ground holds the wheel: the result.
    pub(crate) torque: f32,
}

/// Velocities of a body, in its own frame or the world's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Velocity {
    pub(crate) vx: f32,
    pub(crate) vy: f32,
    pub(crate) wz: f32,
}

impl Contact {
    const fn across(&self) -> Vec2 {
        Vec2::new(-self.along.y, self.along.x)
    }

    /// The directions in which the ground holds.
    fn held(&self) -> impl Iterator<Item = Vec2> {
        [Some(self.along), self.holds_across.then(|| self.across())].into_iter().flatten()
    }
}

impl Body {
    /// The contacts of steered wheels may point anywhere: only the place matters here.
    pub(crate) fn new(
        contacts: impl Iterator<Item = Contact> + Clone,
        mass: f32,
        yaw_inertia: f32,
        friction: f32,
    ) -> Self {
        let wheels = contacts.clone().fold(0.0, |count, _| count + 1.0_f32);
        Self {
            mass,
            yaw_inertia,
            traction: friction * mass * GRAVITY / wheels,
            compliance: compliance(contacts, mass, yaw_inertia),
            vx: 0.0,
            vy: 0.0,
            wz: 0.0,
            x: 0.0,
            y: 0.0,
            heading: 0.0,
            push: [0.0; 3],
        }
    }

    /// Moves the body by one step of `dt_s`, and calculates the torques of the ground on the wheels.
    pub(crate) fn step(&mut self, wheels: &mut [Rolling], dt_s: f32) {
        let (sine, cosine) = sin_cos(self.heading_wrapped());
        let Velocity { vx, vy, wz } = self.velocity_body();
        let (mut pull, mut turn) = (Vec2::ZERO, self.push[2]);
        for Rolling { contact, velocity, inertia, torque } in wheels {
            let Contact { position, along, reach, holds_across } = *contact;
            let ground = Vec2::new(vx - wz * position.y, vy + wz * position.x);
            let slip_along = reach * *velocity - along.dot(ground);
            let slip_across = if holds_across { -contact.across().dot(ground) } else { 0.0 };
            // As stiff across as along, where the wheel yields too: so the force is against the slip, in any direction.
            let force = Vec2::new(slip_along, slip_across)
                * held(self.compliance + reach * reach / *inertia, dt_s);
            let size = force.norm();
            let force = if size > self.traction { force * (self.traction / size) } else { force };
            *torque = -reach * force.x;
            let force = along * force.x + contact.across() * force.y;
            pull = pull + force;
            turn += position.cross(force);
        }
        let force_x = self.push[0] + cosine * pull.x - sine * pull.y;
        let force_y = self.push[1] + sine * pull.x + cosine * pull.y;
        self.vx += force_x / self.mass * dt_s;
        self.vy += force_y / self.mass * dt_s;
        self.wz += turn / self.yaw_inertia * dt_s;
        self.x += f64::from(self.vx * dt_s);
        self.y += f64::from(self.vy * dt_s);
        self.heading += f64::from(self.wz * dt_s);
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

/// Returns the force for a slip of 1 m/s, over a whole step: the slip dies out within the step and never turns around,
/// for any stiffness of the contact (an implicit step with all wheels at once, bounded from above).
fn held(compliance: f32, dt_s: f32) -> f32 {
    STIFFNESS / (1.0 + STIFFNESS * compliance * dt_s)
}

/// Returns the largest eigenvalue of `J M^-1 J'`, with a row of `J` for each held direction, or a little more.
///
/// The 3x3 matrix `M^-1/2 J' J M^-1/2` has the same largest eigenvalue, and its largest row sum is an upper bound of it. A
/// tyre's two rows add up to the same in every direction of the tyre.
fn compliance(contacts: impl Iterator<Item = Contact>, mass: f32, yaw_inertia: f32) -> f32 {
    let (x_scale, yaw_scale) = (1.0 / sqrt(mass), 1.0 / sqrt(yaw_inertia));
    let mut matrix = [[0.0_f32; 3]; 3];
    for contact in contacts {
        for direction in contact.held() {
            let arm = contact.position.cross(direction);
            let row = [direction.x * x_scale, direction.y * x_scale, arm * yaw_scale];
            for (line, left) in matrix.iter_mut().zip(row) {
                for (cell, right) in line.iter_mut().zip(row) {
                    *cell += left * right;
                }
            }
        }
    }
    let sum = |line: [f32; 3]| line.iter().fold(0.0, |sum, cell| sum + cell.abs());
    matrix.map(sum).into_iter().fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: f32 = 1e-4;
    const RADIUS: f32 = 0.076;
    const INERTIA: f32 = 8e-3;
    const CORNERS: [Vec2; 4] = [
        Vec2::new(0.2, 0.18),
        Vec2::new(0.2, -0.18),
        Vec2::new(-0.2, 0.18),
        Vec2::new(-0.2, -0.18),
    ];

    fn contact(position: Vec2, degrees: f32, reach: f32, holds_across: bool) -> Contact {
        let (sine, cosine) = sin_cos(degrees.to_radians());
        Contact { position, along: Vec2::new(cosine, sine), reach, holds_across }
    }

    /// Front left, front right, rear left, rear right; the rollers on the floor form an O.
    fn mecanum() -> [Contact; 4] {
        CORNERS.map(|corner| {
            let degrees = if corner.x * corner.y > 0.0 { -45.0 } else { 45.0 };
            contact(corner, degrees, RADIUS * core::f32::consts::FRAC_1_SQRT_2, false)
        })
    }

    fn tyres(degrees: [f32; 4]) -> [Contact; 4] {
        let mut degrees = degrees.into_iter();
        CORNERS.map(|corner| contact(corner, degrees.next().unwrap(), RADIUS, true))
    }

    /// A body of 20 kg on free wheels.
    struct Cart<const N: usize> {
        body: Body,
        wheels: [Rolling; N],
    }

    impl<const N: usize> Cart<N> {
        fn new(contacts: [Contact; N]) -> Self {
            let still = |contact| Rolling { contact, velocity: 0.0, inertia: INERTIA, torque: 0.0 };
            let body = Body::new(contacts.into_iter(), 20.0, 0.8, 0.8);
            Self { body, wheels: contacts.map(still) }
        }

        fn run(&mut self, torques: [f32; N], steps: u32) {
            for _ in 0..steps {
                self.body.step(&mut self.wheels, STEP);
                for (wheel, torque) in self.wheels.iter_mut().zip(torques) {
                    wheel.velocity += (torque + wheel.torque) * STEP / INERTIA;
                }
            }
        }

        fn kinetic(&self) -> f32 {
            let turning: f32 =
                self.wheels.iter().map(|wheel| INERTIA * wheel.velocity * wheel.velocity).sum();
            let Body { vx, vy, wz, .. } = self.body;
            0.5 * (turning + 20.0 * (vx * vx + vy * vy) + 0.8 * wz * wz)
        }

        fn twist(&self) -> [f32; 3] {
            let Velocity { vx, vy, wz } = self.body.velocity_body();
            [vx, vy, wz]
        }

        /// The signs of forward, left and counter-clockwise.
        fn direction(&self) -> [i32; 3] {
            self.twist().map(|v| i32::from(v > 0.05) - i32::from(v < -0.05))
        }
    }

    #[test]
    fn equal_torques_drive_forward_with_the_inertia_of_body_and_wheels() {
        for contacts in [mecanum(), tyres([0.0; 4])] {
            let mut cart = Cart::new(contacts);
            cart.run([1.0; 4], 5_000);
            let mass = 20.0 + 4.0 * INERTIA / (RADIUS * RADIUS);
            let expected = 4.0 / RADIUS / mass * 0.5;
            let [vx, vy, wz] = cart.twist();
            assert!((vx / expected - 1.0).abs() < 0.01, "{vx} and not {expected}");
            assert!(vy.abs() < 1e-4 && wz.abs() < 1e-4);
            let (x, y, _) = cart.body.pose();
            assert!((x / (0.5 * 0.5 * f64::from(expected)) - 1.0).abs() < 0.01 && y.abs() < 1e-3);
        }
    }

    #[test]
    fn the_pattern_of_mecanum_wheels_gives_its_direction() {
        let strafe_left = [-1.0, 1.0, 1.0, -1.0];
        let turn_left = [-1.0, 1.0, -1.0, 1.0];
        for (torques, direction) in
            [(strafe_left, [0, 1, 0]), (turn_left, [0, 0, 1]), ([-1.0; 4], [-1, 0, 0])]
        {
            let mut cart = Cart::new(mecanum());
            cart.run(torques, 1_000);
            assert_eq!(cart.direction(), direction);
        }
    }

    #[test]
    fn three_omni_wheels_turn_together_and_strafe_against_each_other() {
        let ring = |degrees: f32| {
            let (sine, cosine) = sin_cos(degrees.to_radians());
            contact(Vec2::new(cosine, sine) * 0.2, degrees + 90.0, 0.05, false)
        };
        // The rear wheel rolls to the right at its place.
        for (torques, direction) in [
            ([1.0, 1.0, 1.0], [0, 0, 1]),
            ([0.5, 0.5, -1.0], [0, 1, 0]),
            ([-1.0, 1.0, 0.0], [1, 0, 0]),
        ] {
            let mut cart = Cart::new([60.0, -60.0, 180.0].map(ring));
            cart.run(torques, 500);
            assert_eq!(cart.direction(), direction, "{:?}", cart.twist());
        }
    }

    #[test]
    fn a_differential_drive_turns_in_place_and_is_not_pushed_sideways() {
        let side = |y| contact(Vec2::new(0.0, y), 0.0, RADIUS, true);
        let mut cart = Cart::new([side(0.18), side(-0.18)]);
        cart.run([-0.5, 0.5], 500);
        assert_eq!(cart.direction(), [0, 0, 1]);
        let mut cart = Cart::new([side(0.18), side(-0.18)]);
        cart.body.push = [0.0, 100.0, 0.0];
        cart.run([0.0; 2], 5_000);
        assert!(cart.body.pose().1.abs() < 0.01, "{:?}", cart.body.pose());
        cart.body.push = [0.0, 200.0, 0.0]; // more than 0.8 of the weight
        cart.run([0.0; 2], 5_000);
        // A force beyond the friction of the floor accelerates the body for half a second.
        let expected = 0.5 * (200.0 - 0.8 * 20.0 * 9.81) / 20.0 * 0.25;
        assert!((cart.body.pose().1 / expected - 1.0).abs() < 0.03, "{:?}", cart.body.pose());
    }

    #[test]
    fn four_tyres_turn_only_by_scrubbing_and_modules_that_point_round_roll() {
        let turn = |contacts, torques: [f32; 4]| {
            let mut cart = Cart::new(contacts);
            cart.run(torques, 1_000);
            cart.twist()[2]
        };
        let scrubbing = turn(tyres([0.0; 4]), [-1.0, 1.0, -1.0, 1.0]);
        let rolling = turn(tyres([132.0, 48.0, -132.0, -48.0]), [1.0; 4]);
        // Four wheels at 0.269 m from the centre turn the body and themselves.
        let arm = 0.2_f32.hypot(0.18) / RADIUS;
        let expected = 4.0 * arm / (0.8 + 4.0 * INERTIA * arm * arm) * 0.1;
        assert!((rolling / expected - 1.0).abs() < 0.02, "{rolling} and not {expected}");
        assert!(scrubbing.abs() < 0.02, "{scrubbing}");
    }

    #[test]
    fn modules_drive_where_they_point() {
        let mut cart = Cart::new(tyres([30.0; 4]));
        cart.run([1.0; 4], 1_000);
        let [vx, vy, wz] = cart.twist();
        assert!(vx > 0.1 && (vy / vx - 30.0_f32.to_radians().tan()).abs() < 1e-3, "{vx} {vy}");
        assert!(wz.abs() < 1e-3);
    }

    #[test]
    fn rolling_without_torque_keeps_its_energy_but_for_slip() {
        for contacts in [mecanum(), tyres([0.0; 4])] {
            let mut cart = Cart::new(contacts);
            cart.run([0.5, 0.9, 0.7, 1.1], 3_000);
            cart.run([0.0; 4], 500); // the slip dies out
            let before = cart.kinetic();
            cart.run([0.0; 4], 100_000);
            let after = cart.kinetic();
            assert!(after <= before * 1.0001 && after > 0.98 * before, "{before} J, {after} J");
        }
    }

    #[test]
    fn no_contact_in_any_direction_adds_energy() {
        // Slip in all directions at once, more than the floor holds and less.
        for speed in [0.1, 30.0] {
            for contacts in [mecanum(), tyres([0.0; 4]), tyres([0.0, 30.0, 60.0, 170.0])] {
                let mut cart = Cart::new(contacts);
                (cart.body.vx, cart.body.vy, cart.body.wz) = (0.1 * speed, -0.05 * speed, speed);
                cart.wheels[0].velocity = -speed;
                let mut last = cart.kinetic();
                for _ in 0..2_000 {
                    cart.run([0.0; 4], 1);
                    assert!(cart.kinetic() <= last * 1.000_01, "{} J, {last} J", cart.kinetic());
                    last = cart.kinetic();
                }
            }
        }
    }

    #[test]
    fn wheels_spin_when_the_torque_is_more_than_the_ground_holds() {
        // Friction 0.8 of gravity, on mecanum wheels along rollers at 45 degrees.
        let sideways = core::f32::consts::FRAC_1_SQRT_2;
        for (contacts, share) in [(mecanum(), sideways), (tyres([0.0; 4]), 1.0)] {
            let mut cart = Cart::new(contacts);
            cart.run([6.0; 4], 2_000);
            let acceleration = cart.twist()[0] / 0.2;
            assert!((acceleration - 0.8 * 9.81 * share).abs() < 0.01, "{acceleration} m/s2");
            assert!(cart.wheels[0].velocity * RADIUS > 2.0 * cart.twist()[0]);
        }
    }

    /// Found by `MuJoCo`: the force was turned away from the slip, to twice as much across as along.
    #[test]
    fn the_floor_acts_against_the_slip_of_a_tyre_in_any_direction() {
        for (spin, drift) in [(40.0, 0.5), (-40.0, 2.0), (3.0, -4.0), (0.2, 0.004)] {
            let mut wheel = [Rolling {
                contact: contact(Vec2::ZERO, 0.0, RADIUS, true),
                velocity: spin,
                inertia: INERTIA,
                torque: 0.0,
            }];
            let mut body = Body::new(wheel.iter().map(|wheel| wheel.contact), 20.0, 0.8, 0.8);
            body.vy = drift;
            body.step(&mut wheel, STEP);
            let force = Vec2::new(body.vx, body.vy - drift) * (20.0 / STEP);
            let slip = Vec2::new(spin * RADIUS, -drift);
            assert!(force.cross(slip).abs() < 0.01 * force.norm() * slip.norm(), "{force:?}");
            assert!(force.dot(slip) > 0.0 && force.norm() < 0.801 * 20.0 * GRAVITY, "{force:?}");
        }
    }

    #[test]
    fn a_tyre_that_spins_does_not_hold_sideways_any_more() {
        let slide = |torque: f32| {
            let mut cart = Cart::new(tyres([0.0; 4]));
            cart.body.push = [0.0, 60.0, 0.0];
            cart.run([torque; 4], 2_000);
            cart.body.pose().1
        };
        assert!(slide(0.5) < 0.005 && slide(8.0) > 0.02, "{} {}", slide(0.5), slide(8.0));
    }

    #[test]
    fn locked_wheels_hold_the_body_against_a_push() {
        for contacts in [mecanum(), tyres([0.0; 4])] {
            let mut cart = Cart::new(contacts);
            cart.body.push = [20.0, -20.0, 2.0];
            for _ in 0..10_000 {
                cart.body.step(&mut cart.wheels, STEP);
            }
            let (x, y, heading) = cart.body.pose();
            assert!(x.abs() < 0.01 && y.abs() < 0.01 && heading.abs() < 0.05, "{x} {y} {heading}");
        }
    }

    #[test]
    fn velocity_in_the_body_turns_with_the_heading() {
        let mut cart = Cart::new(mecanum());
        cart.body.vx = 1.0;
        cart.body.heading = core::f64::consts::FRAC_PI_2 + 100.0 * core::f64::consts::TAU;
        let [vx, vy, _] = cart.twist();
        assert!(vx.abs() < 1e-5 && (vy + 1.0).abs() < 1e-5);
    }
}
