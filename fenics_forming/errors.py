"""What can go wrong, in words: every error of the package is a `FormingError`."""

import shutil
import textwrap
from difflib import get_close_matches


def did_you_mean(word, allowed):
    """`"did you mean 'mesh_size'?"` for a misspelt word, or an empty string when nothing is near."""
    near = get_close_matches(str(word), [str(a) for a in allowed], n=1, cutoff=0.6)
    return f"did you mean '{near[0]}'?" if near else ""


def as_lines(text, stream, *, indent=2):
    """The text with its lines broken between words where the stream is a terminal that is too narrow for them."""
    if not stream.isatty():
        return text
    width = shutil.get_terminal_size().columns
    return "\n".join(
        textwrap.fill(line, width, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False)
        for line in text.splitlines()
    )


class FormingError(Exception):
    """Base of all errors that the package raises on purpose."""


class SceneError(FormingError):
    """A scene that cannot be meant: where, what was found, what is allowed, what to try.

    Parameters
    ----------
    sentence : one line without a newline, such as "is negative; a positive length such as '1 mm' is expected".
    key : dotted key, such as "workpieces.billet.mesh_size"; printed in front of the sentence.
    got : the value that was found.
    allowed : what would have been right: a sequence of words, or a phrase.

    Attributes
    ----------
    problems : list of `SceneError`, one for each problem; `[self]` for a single one.
    """

    def __init__(self, sentence, *, key="", got=None, allowed=None):
        self.key, self.got, self.allowed = key, got, allowed
        self.problems = [self]
        super().__init__(f"{key}: {sentence}" if key else sentence)

    @classmethod
    def joined(cls, problems):
        """One error out of several, one line for each; key, got and allowed are those of the first."""
        problems = [single for problem in problems for single in problem.problems]
        if len(problems) == 1:
            return problems[0]
        error = cls("\n".join(str(problem) for problem in problems))
        first = problems[0]
        error.key, error.got, error.allowed, error.problems = first.key, first.got, first.allowed, problems
        return error


class MeshError(FormingError):
    """A mesh that could not be made, read or kept valid."""


class ConvergenceError(FormingError):
    """The equations could not be solved even with the smallest step.

    Parameters
    ----------
    sentence : what failed, and where in the run.
    history : the residuals or increments of the failed attempts, oldest first.
    advice : what the user can try.
    """

    def __init__(self, sentence, *, history=(), advice=""):
        self.sentence, self.history, self.advice = sentence, list(history), advice
        super().__init__(f"{sentence}; {advice}" if advice else sentence)
