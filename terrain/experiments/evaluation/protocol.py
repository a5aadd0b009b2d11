"""What an evaluation consists of, with a hash of all of it: worlds, seeds, configurations, and the rules of the judge.

Code is not in the hash. A result names the version of the package that made it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from mbf_abstract.config.findings import ConfigError, Finding
from terrain.provenance.frozen_keys import under_frozen_keys
from terrain.provenance.named_files import hash_with_named_files
from terrain.scenarios.scenario import Scenario

Judge = Callable[[Scenario, int], bool]
"""Whether a robot can get to the goal of a scenario with this seed at all."""

LENGTH = 12  # characters of a hash
FROZEN_KEYS = {"mesh": {"obstacle_max_range": "max_obstacle_dist"}}
"""Parameters that have another name now, by the backend of their configuration: the hash keeps the earlier one."""


@dataclass(frozen=True)
class Trial:
    """One world, to be driven once by everyone."""

    scenario: Scenario
    seed: int


@dataclass(frozen=True)
class Entry:
    """Who takes part: a name, the map it plans on, and what it changes in the protocol's configuration of that map.

    Attributes
    ----------
    settings : mapping of str to str
        As for ``mbf run --set``, see ``terrain.scenarios.settings``.
    code : str
        Hash of the plugins' code, for plugins that do not come with this package.
    """

    name: str
    backend: str
    settings: Mapping[str, str] = field(default_factory=dict)
    code: str = ""


@dataclass(frozen=True)
class Protocol:
    """An evaluation.

    Attributes
    ----------
    about : str
        What it is, in a sentence.
    backend : str
        Map of an entry that names none.
    trials : sequence of Trial
        At least one; all with the same configurations.
    rules : mapping
        Parameters of the judge and of what counts as a success, as they stand in the results.
    entries : mapping of str to Entry
        The shipped ones.
    part : str
        Which one it is of several sets of worlds with tables of their own; empty where there is one.
    """

    name: str
    version: str
    about: str
    backend: str
    trials: Sequence[Trial]
    rules: Mapping[str, Any]
    judge: Judge
    entries: Mapping[str, Entry]
    part: str = ""

    @property
    def title(self) -> str:
        """Name, part and version."""
        return " ".join(word for word in (self.name, self.part, self.version) if word)

    def entry(self, name: str) -> Entry:
        """Return a shipped entry; raises ConfigError if there is none of this name."""
        if name not in self.entries:
            known = ", ".join(self.entries)
            raise ConfigError([Finding(f"mbf bench {self.name}", 1, "--beside", f"one of {known}", repr(name))])
        return self.entries[name]

    @property
    def hash(self) -> str:
        """Of the protocol with all its trials."""
        return _hash_of(list(self._hashes.values()))

    def trial_hash(self, trial: Trial) -> str:
        """Return the hash of one trial and of the rules; two results with the same one can be compared."""
        return self._hashes[trial.scenario.name, trial.seed]

    @cached_property
    def _hashes(self) -> dict[tuple[str, int], str]:
        """Of each trial, by the names of world and seed."""
        first = self.trials[0].scenario
        common = {
            "protocol": [self.name, self.version, dict(self.rules)],
            "navigation": {
                backend: under_frozen_keys(_content(file), FROZEN_KEYS.get(backend, {}))
                for backend, file in sorted(first.navigation.items())
            },
        }
        files = {file for trial in self.trials if (file := _file(trial)) is not None}
        contents = {file: hash_with_named_files(file).hex() for file in files}
        return {
            (trial.scenario.name, trial.seed): _hash_of({**common, **_stated(trial, contents)}) for trial in self.trials
        }


def _file(trial: Trial) -> Path | None:
    """Survey or floor plan of the world, where it is no generated one."""
    file: Path | None = getattr(trial.scenario.world, "file", None)
    return file


def _stated(trial: Trial, contents: Mapping[Path, str]) -> dict[str, Any]:
    """What a trial says, without paths of this machine; defaults that it leaves alone do not count."""
    scenario = trial.scenario
    keys = scenario.model_dump(mode="json", exclude_unset=True, exclude={"navigation": True, "world": {"file"}})
    file = _file(trial)
    return {"scenario": keys, "survey": None if file is None else contents[file], "seed": trial.seed}


def read_entries(file: Path) -> dict[str, Entry]:
    """Read the shipped entries of a protocol: name -> backend, and settings in the form of the configuration."""
    return {
        name: Entry(
            name,
            block["backend"],
            {key: value if isinstance(value, str) else _flow(value) for key, value in block["settings"].items()},
        )
        for name, block in yaml.safe_load(file.read_text("utf-8")).items()
    }


def _flow(value: Any) -> str:
    return yaml.safe_dump(value, default_flow_style=True, width=10_000, sort_keys=False).removesuffix("\n...\n").strip()


def _content(file: Path) -> Any:
    """What a configuration says, whatever its comments and line breaks."""
    return yaml.safe_load(file.read_text("utf-8"))


def _hash_of(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:LENGTH]
