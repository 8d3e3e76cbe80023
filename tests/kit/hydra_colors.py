"""The colours that the shapes of the Hydra tests glow in, so that a picture says what each of its pixels shows."""

GLOW = {"ball": (0.75, 0.0, 0.0), "box": (0.0, 0.75, 0.0), "ring": (0.0, 0.0, 0.75), "floor": (0.75, 0.75, 0.0)}
