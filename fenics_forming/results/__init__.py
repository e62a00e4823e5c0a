"""What a run leaves behind: history, fields, checkpoints, pictures. Nothing here solves."""

from .checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from .files import ResultsError
from .history import History
from .pictures.plotting import plot_fields, plot_force_stroke, plot_run
from .progress import Progress, Silent
from .recording.fields import FieldWriter, read_frames
from .results import Results, write_summary

__all__ = [
    "Checkpoint",
    "FieldWriter",
    "History",
    "Progress",
    "Results",
    "ResultsError",
    "Silent",
    "load_checkpoint",
    "plot_fields",
    "plot_force_stroke",
    "plot_run",
    "read_frames",
    "save_checkpoint",
    "write_summary",
]
