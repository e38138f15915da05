"""Errors of perception as a user would write them, for the tests of whole runs."""

from typing import Any

import numpy as np

from fleet2d import CameraSightings, PerceptionError


class Of(PerceptionError):
    """Base of errors about one person in some steps."""

    person: str
    first: int = 0
    end: int = 1_000_000

    def is_it(self, sightings: CameraSightings) -> Any:
        is_in_time = (sightings.step >= self.first) & (sightings.step < self.end)
        return is_in_time & (sightings.true_user == sightings.users.index(self.person))


class Missed(Of):
    """Somebody isn't noticed."""

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        return sightings.replace(noticed=sightings.noticed & ~self.is_it(sightings))


class Mistaken(Of):
    """Somebody seems to be another person."""

    taken_for: str

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        other = [*sightings.users, "unknown"].index(self.taken_for)
        other = -1 if other == len(sightings.users) else other
        return sightings.replace(user=np.where(self.is_it(sightings), other, sightings.user))


class Blinking(PerceptionError):
    """Everything at once: people vanish for ten seconds, are mixed up, shaken and turned."""

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        is_dark = sightings.uniform("dark", at=sightings.step * sightings.step_s // 10) < 0.3
        is_mixed_up = sightings.uniform("mixed up", at=sightings.step // 20) < 0.2
        user = np.where(
            is_mixed_up, sightings.uniform("who") * len(sightings.users), sightings.user
        )
        return sightings.moved(
            turn_deg=5 * sightings.bell("turn"), offset=sightings.bell("far", shared=True)
        ).replace(
            noticed=~is_dark,
            user=np.floor(user).astype(int),
            heading=sightings.heading + sightings.bell("heading"),
            posture=(sightings.posture + (sightings.uniform("posture") < 0.1)) % 3,
        )


class Wrong(PerceptionError):
    """An error that fails or returns what it may not, from a step on."""

    returns: str

    def distort(self, sightings: CameraSightings) -> Any:
        column = np.where(np.arange(len(sightings)) > 0, np.nan, 1.0)
        match self.returns:
            case "nothing":
                return None
            case "rows":
                return {"x": sightings.x}
            case "nan":
                return sightings.replace(x=column * 0 + np.nan)
            case "far":
                return sightings.replace(y=1e9)
            case "short":
                return sightings.replace(heading=np.zeros(len(sightings) + 1))
            case "words":
                return sightings.replace(heading="north")
            case "posture":
                return sightings.replace(posture=3)
            case "nobody":
                return sightings.replace(user=7)
            case "share":
                return sightings.replace(noticed=0.5)
            case "state":
                self.seen = 1
            case "write":
                sightings.x[0] = 1
        raise KeyError("kitchen")
