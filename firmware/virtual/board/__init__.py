"""A virtual board: executes an unmodified release image and models the chip around the core."""
