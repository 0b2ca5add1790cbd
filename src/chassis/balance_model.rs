use crate::control::solved;
use crate::control::state_space::LinearSystem;
use crate::error::ConfigError;

/// Masses and lengths of a robot that balances on two wheels with legs.
///
/// All of them describe the robot as it stands: a wheel on the floor, a line as leg, a body on top.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BalanceModel {
    /// Radius of a wheel in m.
    pub wheel_radius_m: f32,
    /// Mass of a wheel in kg.
    pub wheel_kg: f32,
    /// Inertia of a wheel about its axle in kg m², with that of the rotor times the square of its gear.
    pub wheel_kg_m2: f32,
    /// Mass of a leg in kg.
    pub leg_kg: f32,
    /// Inertia of a leg about its centre of mass in kg m².
    pub leg_kg_m2: f32,
    /// Where the centre of mass of a leg is: 0 at the wheel, 1 at the hip.
    pub leg_centre: f32,
    /// Mass of the body in kg.
    pub body_kg: f32,
    /// Inertia of the body for pitch about its centre of mass in kg m².
    pub body_kg_m2: f32,
    /// Height of the body's centre of mass above the hips in m; positive is above.
    pub body_height_m: f32,
}

/// Standard gravity in m/s².
pub(super) const GRAVITY: f32 = 9.806_65;

impl BalanceModel {
    /// Returns the plant about upright, for a leg length in m and a time step in s.
    ///
    /// ```text
    /// states   lean of the legs to the vertical, its rate; place and velocity of the wheels; pitch of the body, its rate (rad, m, s)
    /// inputs   torque of the wheels, torque of the body on the legs, of both sides together, in Nm
    /// ```
    /// Positive leans and rolls forward.
    ///
    /// # Errors
    /// Names the parameter: a length, mass or inertia of the wheels or the body that is not above zero; another one that is not finite.
    pub fn plant(&self, length_m: f32, dt_s: f32) -> Result<LinearSystem<6, 2>, ConfigError> {
        let positive = [
            (self.wheel_radius_m, "wheel_radius_m"),
            (self.wheel_kg, "wheel_kg"),
            (self.body_kg, "body_kg"),
            (self.body_kg_m2, "body_kg_m2"),
            (length_m, "length_m"),
        ];
        for (value, name) in positive {
            super::error::positive(value, name)?;
        }
        let not_negative = [
            (self.wheel_kg_m2, "wheel_kg_m2"),
            (self.leg_kg, "leg_kg"),
            (self.leg_kg_m2, "leg_kg_m2"),
            (self.leg_centre, "leg_centre"),
        ];
        for (value, name) in not_negative {
            super::error::not_negative(value, name)?;
        }
        if !self.body_height_m.is_finite() {
            return Err(ConfigError::NotFinite("body_height_m"));
        }
        let radius = self.wheel_radius_m;
        let wheels = 2.0 * (self.wheel_kg + self.wheel_kg_m2 / (radius * radius));
        let (leg, centre) = (2.0 * self.leg_kg, self.leg_centre * length_m);
        let (body, height) = (self.body_kg, self.body_height_m);
        // Kinetic energy of place, lean and pitch: half of vᵀ M v.
        let by_lean = leg * centre + body * length_m;
        let of_lean = leg * centre * centre + 2.0 * self.leg_kg_m2 + body * length_m * length_m;
        let mass = [
            [wheels + leg + body, by_lean, body * height],
            [by_lean, of_lean, body * length_m * height],
            [body * height, body * length_m * height, self.body_kg_m2 + body * height * height],
        ];
        // What moves them: lean and pitch by gravity, torques of the wheels and the hips.
        let forces = [
            [0.0, 0.0, 1.0 / radius, 0.0],
            [GRAVITY * by_lean, 0.0, -1.0, 1.0],
            [0.0, GRAVITY * body * height, 0.0, -1.0],
        ];
        // Without a solution, the plant is not finite, and refused.
        let [place, lean, pitch] = solved(&mass, &forces).unwrap_or([[f32::NAN; 4]; 3]);
        let states = |[lean, pitch, ..]: [f32; 4]| [lean, 0.0, 0.0, 0.0, pitch, 0.0];
        let inputs = |[.., wheel, hip]: [f32; 4]| [wheel, hip];
        let a = [
            [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            states(lean),
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            states(place),
            [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            states(pitch),
        ];
        let b = [[0.0; 2], inputs(lean), [0.0; 2], inputs(place), [0.0; 2], inputs(pitch)];
        LinearSystem::discretized(&a, &b, dt_s)
    }
}
