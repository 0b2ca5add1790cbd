"""The rows of the table: what goes wrong, one function a fault. Each returns what it measured, and raises if the program does wrong."""
from . import board, drivers, line, motors, operator, sentry, snake
from .judge import ROWS, Wrong, of

__all__ = ["ROWS", "Wrong", "board", "drivers", "line", "motors", "of", "operator", "sentry", "snake"]
