"""The reward of one step, in named parts."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from mbf_abstract.parameters import ParameterModel, parameter


class RewardWeights(ParameterModel):
    """What each part is worth; penalties are positive numbers that are subtracted."""

    progress: float = parameter(1.0, "Of each metre by which the distance left becomes shorter.", unit="1/m", ge=0.0)
    arrival: float = parameter(10.0, "Of the last goal, once.", ge=0.0)
    contact: float = parameter(10.0, "Penalty for a contact or another end that is a failure, once.", ge=0.0)
    tilt: float = parameter(0.0, "Penalty for a tilt of 1 rad over a second.", unit="1/(rad s)", ge=0.0)
    effort: float = parameter(0.01, "Penalty for the sum of squared changes of the action.", ge=0.0)
    time: float = parameter(0.05, "Penalty for a second.", unit="1/s", ge=0.0)


@dataclass(frozen=True)
class StepFacts:
    """What a step is rewarded by.

    Attributes
    ----------
    gained : float
        By how much the distance left has become shorter [m].
    arrived, failed : bool
        At the last goal; or ended by the judge otherwise.
    tilt : float
        Of the robot after the step [rad].
    change : float
        Sum of the squared differences from the last action.
    seconds : float
        Length of the step [s].
    """

    gained: float
    arrived: bool
    failed: bool
    tilt: float
    change: float
    seconds: float


@dataclass(frozen=True)
class RewardParts:
    """The parts of a reward, with their signs; the reward is their sum."""

    progress: float
    arrival: float
    contact: float
    tilt: float
    effort: float
    time: float

    @classmethod
    def of(cls, facts: StepFacts, weights: RewardWeights) -> RewardParts:
        """Weigh what a step has brought."""
        return cls(
            progress=weights.progress * facts.gained,
            arrival=weights.arrival if facts.arrived else 0.0,
            contact=-weights.contact if facts.failed else 0.0,
            tilt=-weights.tilt * facts.tilt * facts.seconds,
            effort=-weights.effort * facts.change,
            time=-weights.time * facts.seconds,
        )

    @property
    def total(self) -> float:
        """The reward."""
        return self.progress + self.arrival + self.contact + self.tilt + self.effort + self.time

    def to_json(self) -> dict[str, float]:
        """Return the parts by their names."""
        return asdict(self)
