"""The backlash models: one row of traits each, in the order in which ``backlash_model`` counts them.

The equations ask for traits and never for a model by name, so a further model is a further row, at the end; a law that
is its own (another torque of the teeth) goes where the equations ask for the trait that it brings.
"""

from typing import NamedTuple


class BacklashModel(NamedTuple):
    """One model."""

    name: str  # as in the FMU and on the command line
    description: str  # of the FMU's enumeration
    gap: bool = True  # False for the shaft without one
    plain_when_closed: bool = False  # without a gap it is the plain shaft
    rigid: bool = False  # teeth in contact couple motor and load as one body
    held: bool = False  # the load stands still inside the gap
    bounces: bool = False  # teeth that meet rebound by the coefficient of restitution
    never_pulls: bool = False  # teeth part when their torque reaches zero
    own_contact: bool = False  # stiffness and damping are those of the contact, not of the shaft
    gradual: bool = False  # the damping of teeth that meet may set in with their penetration
    predicted: bool = False  # the one-step predictor of a diagnosis can follow it


MODELS = (
    BacklashModel("none", "Elastic shaft without a gap", gap=False, predicted=True),
    BacklashModel(
        "dead_zone", "Elastic shaft behind a dead zone", plain_when_closed=True, gradual=True, predicted=True
    ),
    BacklashModel(
        "nordin", "Elastic shaft behind a gap, the teeth never pull", plain_when_closed=True, never_pulls=True,
        predicted=True,
    ),
    BacklashModel(
        "hysteresis", "Play: the load follows the motor at either flank, else stands still", rigid=True, held=True
    ),
    BacklashModel(
        "rigid_impact", "Rigid bodies that collide with a coefficient of restitution", rigid=True, bounces=True
    ),
    BacklashModel(
        "elastic_impact", "Bodies that collide through a contact stiffness and damping", never_pulls=True,
        own_contact=True,
    ),
    # Further models follow here: numbers are part of what users have.
)  # fmt: skip

BACKLASH_MODELS = tuple(model.name for model in MODELS)
NONE, DEAD_ZONE, NORDIN, HYSTERESIS, RIGID_IMPACT, ELASTIC_IMPACT = range(6)

# Which models have a trait, by number: the equations test ``model in RIGID``.
PLAIN_WHEN_CLOSED = tuple(n for n, model in enumerate(MODELS) if model.plain_when_closed)
RIGID = tuple(n for n, model in enumerate(MODELS) if model.rigid)
HELD = tuple(n for n, model in enumerate(MODELS) if model.held)
BOUNCING = tuple(n for n, model in enumerate(MODELS) if model.bounces)
NEVER_PULLING = tuple(n for n, model in enumerate(MODELS) if model.never_pulls)
OWN_CONTACT = tuple(n for n, model in enumerate(MODELS) if model.own_contact)
GRADUAL = tuple(n for n, model in enumerate(MODELS) if model.gradual)
