"""Points that a run's range sensors hit, for maps built from what a robot saw itself (``mbf map build --from-run``)."""

from __future__ import annotations

from pathlib import Path

from mbf_abstract.config.bounded_files import ArrayFileError, read_arrays
from mbf_abstract.geometry import FloatArray
from terrain.recording.recording import RecordingError

SCANS = "scans"
BYTES_A_POINT = 24


def read_run_points(folder: Path, max_points: int) -> FloatArray:
    """Read the recorded hits (n, 3) [m], in the map frame of the run; a recording keeps every tenth scan.

    Raises
    ------
    RecordingError
        There is no recording in the folder, it is damaged, has no range sensor, or more than ``max_points`` hits.
    """
    file = folder / "recording.npz"
    if not file.exists():
        raise RecordingError(f"{folder}: expected the folder of a run, with {file.name}, got one without it")
    try:
        arrays = read_arrays(file, BYTES_A_POINT * max_points, (SCANS,))
    except (OSError, ArrayFileError) as error:
        raise RecordingError(f"{file}: is not a readable recording: {error}") from error
    if SCANS not in arrays or arrays[SCANS].ndim != 2 or arrays[SCANS].shape[1] != 3:
        raise RecordingError(f"{file}: expected the recording of a run, got one without scans (n, 3)")
    if not len(arrays[SCANS]):
        raise RecordingError(f"{file}: expected hits of range sensors, got none in this run")
    return arrays[SCANS]
