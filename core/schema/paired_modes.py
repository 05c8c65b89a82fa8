"""Measured modes and those of a model that were paired with them."""

from __future__ import annotations

from msgspec import Struct, field

from femubench.core.schema.bounds import Hertz, Mac, PredictedHertz, StdHertz, Text, Weight, Whole


class PartnerCandidate(Struct, frozen=True, gc=False, array_like=True):
    """A mode of a model that may stand for a measured one, and is the partner of no other.

    Arguments:
        weight: how far the sensors see it in the measured shape, in parts of the partner's.
    """

    hz: Hertz
    weight: Weight
    mac: Mac


class ModeBefore(Struct, frozen=True, gc=False, array_like=True):
    """The mode of the structure as tested that has the shape of a modified one."""

    number: Whole
    mac: Mac


class PairedMode(Struct, frozen=True, gc=False, omit_defaults=True):
    """One measured mode and the model's mode that was paired with it by shape.

    Arguments:
        number: label of the measured mode; ``mode`` in JSON.
        measured_hz: its frequency.
        predicted_hz: the model's; None where no mode of the model matches. A negative number
            stands for an imaginary frequency.
        mac: of the two shapes, 0..1; None where nothing was paired or no shape was measured.
        modification: name of the design change; None for the structure as tested.
        predicted_std_hz: standard deviation of what a test would find about `predicted_hz`, its
            own error of measurement included; None where the strategy does not say.
        candidates: other modes of the model that may stand for the measured one.
        before: of a modified mode, in what the textbook model predicts, the tested one of its
            shape.
    """

    number: Whole = field(name="mode")
    measured_hz: Hertz
    predicted_hz: PredictedHertz | None
    mac: Mac | None
    modification: Text | None = None
    predicted_std_hz: StdHertz | None = None
    candidates: tuple[PartnerCandidate, ...] = ()
    before: ModeBefore | None = None
