"""Elements of a scene, with the tracer that they were laid with."""

import numpy as np

from usdslf.elements.elements import sample_elements
from usdslf.rays import RayTracer


def sample(scene, count=600, seed=3):
    tracer = RayTracer(scene)
    return tracer, sample_elements(scene, tracer, count, np.random.default_rng(seed))
