"""What a count of a field has to be, by exact arithmetic. Nothing here has a tolerance: a count is right, or it is proved that
the exact value is so near to a boundary that the rounding of the implementation takes it to the other side."""

import math
from fractions import Fraction

import numpy as np

SINGLE, DOUBLE = Fraction(1, 2**24), Fraction(1, 2**53)


class Field:
    """A number of a frame: counts of 0 to `top` over a range."""

    def __init__(self, lower, upper, top):
        self.lower, self.upper, self.top = lower, upper, top

    def exact(self, value):
        """The count before it is rounded, as a fraction."""
        if value >= self.upper:
            return Fraction(self.top)
        if value <= self.lower:
            return Fraction(0)
        lower, upper = Fraction(self.lower), Fraction(self.upper)
        return (Fraction(value) - lower) * self.top / (upper - lower)

    def value(self, counts):
        """What counts stand for, in double precision."""
        return self.lower + np.asarray(counts, np.float64) * (self.upper - self.lower) / self.top


class Rule:
    """How an implementation makes counts: by truncation or to the nearest, and how exact each of its operations is."""

    def __init__(self, nearest, unit):
        self.half = Fraction(1, 2) if nearest else Fraction(0)
        # Difference, product and quotient, and the addition of the half: each rounds once.
        self.error = (1 + unit) ** (4 if nearest else 3) - 1

    def is_right(self, field, value, count):
        """Whether a count is that of the value, or the exact value lies within the rounding error of the boundary between."""
        exact = field.exact(value)
        right = min(math.floor(exact + self.half), field.top)
        if count == right:
            return True
        boundary = max(count, right) - self.half
        return abs(count - right) == 1 and abs(exact - boundary) <= (exact + self.half) * self.error

    def are_surely_right(self, field, values, counts):
        """The same for many at once in double precision: `True` only where no rounding of a double can change the answer."""
        inside = np.clip(values.astype(np.float64), field.lower, field.upper)
        exact = (inside - field.lower) * field.top / (field.upper - field.lower) + float(self.half)
        # The error of `exact` is below 65536 * 2^-50.
        is_clear = np.abs(exact - np.rint(exact)) > 1e-9
        return is_clear & (np.floor(exact) == counts)
