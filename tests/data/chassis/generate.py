"""Writes golden.txt: what each chassis must do, computed apart from the crate, in double precision.

Nothing here uses the crate's formulas. A wheel's velocity is the velocity of its point of contact, from the
position of two instants of a rigid motion (a central difference of 1e-6 s), projected on the direction in which the wheel
can transmit: a mecanum wheel along its roller's axis, an omni wheel along its rolling direction.

Run: python3 generate.py > golden.txt
Line: layout | vx vy wz | wheel values.  rad/s; for swerve: rad/s and degrees for each module.
Line: layout | about x y wz | wheel values, for a pure rotation with wz about the point (x, y) of the body.
"""
import cmath
import math

STEP = 1e-6


def contact(point, vx, vy, wz):
    """Velocity of a point of the body, by moving the body."""

    def place(t):
        return complex(vx, vy) * t + point * cmath.exp(1j * wz * t)

    return (place(STEP) - place(-STEP)) / (2 * STEP)


def about(point, x, y, wz):
    """Velocity of a point of the body while the body turns about (x, y)."""
    centre = complex(x, y)

    def place(t):
        return centre + (point - centre) * cmath.exp(1j * wz * t)

    return (place(STEP) - place(-STEP)) / (2 * STEP)


def through_roller(point, axis_degrees, radius):
    """Wheel rolling along x; its roller slides freely across its own axis and transmits along it."""
    axis = cmath.exp(1j * math.radians(axis_degrees))

    def wheel(move, motion):
        velocity = move(point, *motion)
        along = (velocity * axis.conjugate()).real
        return along / axis.real / radius  # the wheel's surface speed has the same part along the axis

    return wheel


def rolling(point, degrees, radius):
    direction = cmath.exp(1j * math.radians(degrees))
    return lambda move, motion: (move(point, *motion) * direction.conjugate()).real / radius


R, A, B = 0.076, 0.20, 0.18
CORNERS = [complex(A, B), complex(A, -B), complex(-A, B), complex(-A, -B)]
# Rollers that form an O on the floor: across the line to the centre; front left and rear right lie at -45 degrees.
O_AXES = [-45, 45, 45, -45]
X_AXES = [45, -45, -45, 45]
WIDE = [complex(0.1, 0.3), complex(0.1, -0.3), complex(-0.1, 0.3), complex(-0.1, -0.3)]
ring = lambda degrees, distance: distance * cmath.exp(1j * math.radians(degrees))
LAYOUTS = {
    "mecanum_o": [through_roller(p, a, R) for p, a in zip(CORNERS, O_AXES)],
    "mecanum_x": [through_roller(p, a, R) for p, a in zip(WIDE, X_AXES)],
    "omni_three": [rolling(ring(d, 0.2), d + 90, 0.05) for d in (60, -60, 180)],
    "omni_four": [rolling(ring(d, 0.25), d + 90, 0.05) for d in (45, -45, 135, -135)],
    "omni_off_centre": [
        rolling(complex(x, y), d, 0.06)
        for x, y, d in ((0.3, 0.1, 100), (0.0, -0.2, 10), (-0.1, 0.3, 170), (-0.3, -0.2, -60))
    ],
    "differential": [rolling(complex(0, B), 0, R), rolling(complex(0, -B), 0, R)],
}
MOTIONS = [
    (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1),
    (0.7, -0.4, 2.5), (-1.3, 2.1, -3.2), (0.05, 0.02, 11.0),
]

TURNS = [(0.3, -0.2, 2.0), (-0.5, 0.1, -1.5), (0.2, 0.18, 1.0)]
CASES = [(contact, motion, "") for motion in MOTIONS] + [(about, turn, "about ") for turn in TURNS]

for name, wheels in LAYOUTS.items():
    for move, motion, word in CASES:
        values = " ".join(f"{wheel(move, motion):.6f}" for wheel in wheels)
        print(f"{name} | {word}{' '.join(map(str, motion))} | {values}")
SWERVES = {"swerve": CORNERS, "swerve_off_centre": [complex(0.3, 0.1), complex(0.0, -0.2), complex(-0.1, 0.3)]}
for name, places in SWERVES.items():
    for move, motion, word in CASES:
        velocities = [move(p, *motion) for p in places]
        values = " ".join(f"{abs(v) / R:.6f} {math.degrees(cmath.phase(v)):.4f}" for v in velocities)
        print(f"{name} | {word}{' '.join(map(str, motion))} | {values}")
