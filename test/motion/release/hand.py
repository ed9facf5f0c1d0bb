"""A simulated hand that swings a body and releases it, and what a tracker sees of both."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.release import BodyShape, Fall, HandPath, Track, find_fall

PLANNED, COMMANDED = 0.38, 0.33
CUBE = BodyShape(CONTACTNETS_CUBE.vertices, CONTACTNETS_CUBE.inertia, CONTACTNETS_CUBE.gravity)


@dataclass(frozen=True, eq=False)
class Thrown:
    """A body that a hand swings and releases; the hand is off its plan by `off`(t), (..., 3) [m]."""

    velocity: Array
    spin: Array
    fall: float = 0.39
    noise: float = 1e-4
    seed: int = 0
    off: Callable[[Array], Array] = lambda times: np.zeros((*np.shape(times), 3))

    @property
    def hand(self) -> HandPath:
        """Speeds up for 0.35 s, goes on steadily for 0.06 s, slows down."""
        times = np.arange(0.0, 0.76, 0.002)
        up, down = np.clip(times / 0.35, 0.0, 1.0), np.clip((times - 0.41) / 0.35, 0.0, 1.0)
        share = (3.0 * up**2 - 2.0 * up**3) * (1.0 - 3.0 * down**2 + 2.0 * down**3)
        way = np.concatenate([[0.0], np.cumsum(0.001 * (share[1:] + share[:-1]))])
        return HandPath(times, np.array([-0.3, 0.0, 0.2]) + way[:, None] * self.velocity)

    @property
    def release(self) -> tuple[Array, Array]:
        near = self.fall + np.array([-1e-5, 0.0, 1e-5])
        places, velocities = self.hand.at(near)
        off = self.off(near)
        return places[1] + off[1], velocities[1] + (off[2] - off[0]) / 2e-5

    def track(self, *, stays: bool = False) -> Track:
        rng, (place, velocity) = np.random.default_rng(self.seed), self.release
        times = np.arange(-0.05, 0.62, 1.0 / 148.0)
        flown = (times - self.fall)[:, None]
        flight = place + velocity * flown - 0.5 * np.array([0.0, 0.0, CUBE.gravity]) * flown**2
        held = self.hand.at(times)[0] + self.off(times)
        places = held if stays else np.where(flown < 0.0, held, flight)
        turned = quaternions.exp(flown * self.spin)
        wobble = quaternions.exp(self.noise / 0.05 * rng.standard_normal((len(times), 3)))
        return Track(times, places + self.noise * rng.standard_normal(places.shape), quaternions.multiply(turned, wobble))

    def found(self, track: Track | None = None) -> Fall | str:
        return find_fall(self.track() if track is None else track, self.hand, COMMANDED, PLANNED, CUBE)


def thrown(seed: int, noise: float = 1e-4) -> Thrown:
    rng = np.random.default_rng(seed)
    velocity, spin = rng.uniform([0.3, -0.3, -0.2], [1.1, 0.3, 0.3]), rng.uniform(-5.0, 5.0, 3)
    error = rng.normal(0.0, [[2e-3], [0.01], [0.2]], (3, 3))  # of place, velocity and acceleration
    fall = 0.39 + 0.01 * rng.standard_normal()

    def off(times: Array) -> Array:
        s = np.asarray(times)[..., None] - PLANNED
        return np.asarray(error[0] + error[1] * s + 0.5 * error[2] * s**2 * (np.abs(s) < 0.2))

    return Thrown(velocity, spin, fall, noise, seed, off)
