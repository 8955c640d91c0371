"""A ball that bounces, as a slave with events whose solution is known."""

import math

from orchestrator.master.protocol import EventUpdate, StepOutcome
from tests.support.mock_slave import model, variable

G, RESTITUTION, HEIGHT = 9.81, 0.7, 1.0
BALL = model("Ball", variable("h", "output", HEIGHT), variable("v", "output"), has_events=True)


def fall(v, time, step):
    """Fall freely, at most to the floor."""
    hit = (v["v"] + math.sqrt(v["v"] ** 2 + 2.0 * G * max(v["h"], 0.0))) / G
    if v.get("down") or hit > step:
        hit = step
    else:
        v["down"] = True
    v["h"] += v["v"] * hit - 0.5 * G * hit**2
    v["v"] -= G * hit
    return StepOutcome(time + hit, bool(v.get("down")))


def bounce(v):
    if v.get("down"):
        v["h"], v["v"], v["down"] = 0.0, -RESTITUTION * v["v"], False
    return EventUpdate()


def bounces(count):
    """The instants at which a ball hits the floor [s]."""
    times = [math.sqrt(2.0 * HEIGHT / G)]
    speed = G * times[0]
    while len(times) < count:
        speed *= RESTITUTION
        times.append(times[-1] + 2.0 * speed / G)
    return times


def height(t):
    """The height of the ball at a time [m]."""
    times = bounces(8)
    if t < times[0]:
        return HEIGHT - 0.5 * G * t**2
    last = max(k for k, time in enumerate(times) if time <= t)
    speed, since = G * times[0] * RESTITUTION ** (last + 1), t - times[last]
    return speed * since - 0.5 * G * since**2
