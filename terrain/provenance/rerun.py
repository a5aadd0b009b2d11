"""Repeats a run from its folder alone and compares the two drives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from mbf_abstract.config.findings import ConfigError, Finding
from terrain.provenance.differences import RunDifferences, compare_runs, read_metrics
from terrain.provenance.provenance import FILE, SCENARIO, Provenance, changed_files, read_provenance
from terrain.scenarios.scenario import load_scenario
from terrain.session.executives import EXECUTIVES
from terrain.session.runner import RunOptions, RunResult, run_scenario


@dataclass(frozen=True)
class Repetition:
    """A run that was repeated.

    Attributes
    ----------
    provenance : Provenance
        Of the earlier run.
    changed_files : tuple of str
        Files of the earlier run's folder that are not what they were, or are missing.
    result : RunResult
        Of the repetition.
    """

    provenance: Provenance
    changed_files: tuple[str, ...]
    result: RunResult
    differences: RunDifferences


def rerun(folder: Path, options: RunOptions) -> Repetition:
    """Repeat the run of a folder.

    Parameters
    ----------
    folder : Path
        Of a finished run on simulated time.
    options : RunOptions
        The folder of the repetition, and what is called during the run; all else is that of the earlier run.

    Raises
    ------
    ConfigError
        It is no folder of a run, or of one that cannot be repeated; all findings.
    """
    provenance = read_provenance(folder)
    metrics = read_metrics(folder)
    if provenance.clock == "real":
        expected = "simulated: real time (--wall-clock) gives another drive each time"
        raise ConfigError([Finding(str(folder / FILE), 1, "clock", expected, provenance.clock)])
    if provenance.executive not in EXECUTIVES and ":" not in provenance.executive:
        expected = f"one of {', '.join(EXECUTIVES)}, or a tree: what somebody outside has driven cannot be repeated"
        raise ConfigError([Finding(str(folder / FILE), 1, "executive", expected, repr(provenance.executive))])
    if options.folder.resolve() == folder.resolve():
        raise ConfigError([Finding(str(folder), 1, "", "another folder for the repetition", "the same one")])
    scenario = load_scenario(folder / SCENARIO)
    changed = tuple(changed_files(folder, provenance))
    options = replace(options, executive=provenance.executive, geodesic="spl" in metrics)
    result = run_scenario(scenario, options)
    differences = compare_runs(folder, options.folder, (provenance, read_provenance(options.folder)))
    return Repetition(provenance, changed, result, differences)
