"""Reads a submission to a leaderboard: a folder with a card and a controller.

    my_controller/
        card.toml            author, licence, inputs
        controller.py        or a policy file (.npz), or a library with the Bladed interface (.so)

A policy file contains arrays and no code. `fowt dev leaderboard run` runs a Python file or a library only
with --trust-code, and then in a separate process (training.board.isolated).
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator

from fowt_env.control import EXACT, PRIVILEGED_INPUTS
from fowt_env.controllers import CONTROLLERS
from fowt_env.controllers.bladed.controller import DLL_PREFIX, PITCH, named_library
from fowt_env.controllers.bladed.swap import INFORMATION
from fowt_env.controllers.policy.network_file import read_policy
from fowt_env.descriptions.checks import parse_names
from fowt_env.descriptions.files import raise_problems, read_toml
from fowt_env.descriptions.lidar import lidars
from fowt_env.descriptions.records import Positive, Record, checked_record
from fowt_env.errors import InputError, unknown
from fowt_env.plant.measurement import Measurement
from fowt_env.training.board.isolated import digest_of
from fowt_env.training.evaluation.run_case import PARKED

CARD = "card.toml"
BUILT_IN, POLICY_FILE, PYTHON_FILE, LIBRARY = "built-in", "policy file", "Python file", "library"
CODE = (PYTHON_FILE, LIBRARY)  # kinds that run in a process of their own
NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,49}")
RESERVED = (PARKED,)  # name of turbines without a controller
MOST_TIMES, FURTHEST = 100, 60.0  # number of preview_times (one time series in memory each); s
LONGEST_TEXT = 2000  # characters of each text of a card
INPUTS = (*Measurement._fields, *PRIVILEGED_INPUTS)
COLLECTIVE_INFORMATION = tuple(name for name in INFORMATION if name in Measurement._fields)


def _tuple(value):
    """Return a list as a tuple; other values unchanged, to be rejected by the validation."""
    return tuple(value) if isinstance(value, list) else value


class Card(Record):
    """Defines the content of card.toml.

    controller     a name of fowt list controllers; "FILE.npz"; "FILE.py:Name", where Name is a class or
                   factory called with (turbine, control_dt), or with nothing; or "FILE.so[,INPUT_FILE]"
    information    inputs of the controller: fields of Measurement and PRIVILEGED_INPUTS; only for Python
                   files (built-in controllers, policy files and libraries have theirs)
    preview_times  times ahead of the wind preview, s, increasing; with "wind_preview" in information
    preview        "exact", or the lidar preset (fowt list lidars) that measures the wind ahead
    tuning         tuned settings or training, with seeds and budget
    """

    name: str
    author: str
    licence: str
    controller: str
    information: Annotated[tuple[str, ...], BeforeValidator(_tuple)] | None = None
    preview_times: Annotated[tuple[Positive, ...], BeforeValidator(_tuple)] = ()
    preview: str = EXACT
    description: str = ""
    tuning: str = ""
    url: str = ""


@dataclass(frozen=True)
class Submission:
    """Holds a checked submission (see read_submission)."""

    card: Card
    folder: Path
    kind: str  # BUILT_IN, POLICY_FILE, PYTHON_FILE or LIBRARY
    digest: str  # SHA-256 of all files

    @property
    def name(self) -> str:
        """Return the name on the board."""
        return self.card.name

    def controller(self, limits: Any, **options: Any) -> Any:
        """Return the controller for evaluate: a name, or a factory of isolated controllers.

        limits: training.board.isolated.ProcessLimits of CODE; options: further fields of the
        IsolatedFactory.
        """
        if self.kind == BUILT_IN:
            return self.card.controller
        if self.kind == POLICY_FILE:
            return f"policy:{(self.folder / self.card.controller).absolute()}"
        from fowt_env.training.board.isolated import IsolatedFactory

        name, information = f"{DLL_PREFIX}{self.card.controller}", COLLECTIVE_INFORMATION
        if self.kind == PYTHON_FILE:
            file, _, attribute = self.card.controller.partition(":")
            name, information = f"{file.removesuffix('.py')}:{attribute}", tuple(self.card.information or ())
        return IsolatedFactory(
            str(self.folder.absolute()), name, self.name, information, self.card.preview_times, limits,
            self.digest, **options,
        )  # fmt: skip


def alike(name: str) -> str:
    """Return a name with "-" replaced by "_"; must be unique on a board."""
    return name.replace("-", "_")


def read_submission(folder: Path | str) -> Submission:
    """Return the submission in a folder without running its code.

    Raises: InputError, with a line per problem, for a folder without a valid card or a usable controller.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"submission {str(folder)!r}: must be a folder with a {CARD}")
    where = f"submission {str(folder)!r}"
    if not (folder / CARD).is_file():
        raise InputError(f"{where}: has no {CARD}")
    card, problems = checked_record(Card, read_toml(folder / CARD, "card"), where), []
    if not NAME.fullmatch(card.name):
        problems.append(
            f"name = {card.name!r}: must be 1 to 50 lower-case letters, digits, '_' or '-', starting with"
            " a letter or digit"
        )
    if card.name in RESERVED:
        problems.append(f"name = {card.name!r}: is reserved")
    texts = ("author", "licence", "controller", "description", "tuning", "url")
    problems += [f"{key} = '': must not be empty" for key in texts[:2] if not getattr(card, key).strip()]
    long = [key for key in texts if len(getattr(card, key)) > LONGEST_TEXT]
    problems += [f"{key}: has more than {LONGEST_TEXT} characters" for key in long]
    if card.preview not in (EXACT, *lidars()):
        problems.append(f"preview: {unknown('preview', card.preview, (EXACT, *lidars()))}")
    kind = _kind(card, folder, problems)
    _check_information(card, kind, problems)
    raise_problems(where, problems)
    return Submission(card, folder, kind, digest_of(folder))


def _kind(card, folder, problems):
    """Return the kind of the controller of a card; append problems of the controller to `problems`."""
    file, colon, attribute = card.controller.partition(":")
    if card.controller.partition(",")[0].endswith(".so"):
        files = [part for part in parse_names(card.controller) if "=" not in part]
        absent = [name for name in files if not _inside(folder, name)]
        problems += [f"controller: there is no file {name!r} in the folder" for name in absent]
        if not absent:
            try:
                _check_library(card.controller, folder)
            except InputError as error:
                problems.append(f"controller: {error}")
        return LIBRARY
    if file.endswith(".py") and colon:
        if not attribute.isidentifier():
            problems.append(f"controller = {card.controller!r}: must be FILE.py:Name")
        elif not _inside(folder, file):
            problems.append(f"controller = {card.controller!r}: there is no file {file!r} in the folder")
        return PYTHON_FILE
    if card.controller.endswith(".npz"):
        if not _inside(folder, card.controller):
            problems.append(f"controller = {card.controller!r}: there is no such file in the folder")
        else:
            try:
                read_policy(folder / card.controller)
            except InputError as error:
                problems.append(f"controller: {error}")
        return POLICY_FILE
    if card.controller not in CONTROLLERS:
        problems.append(
            f"controller: {unknown('controller', card.controller, CONTROLLERS)}; or FILE.npz, FILE.so,"
            " FILE.py:Name"
        )
    return BUILT_IN


def _check_library(controller, folder):
    """Raise InputError for a library that cannot be loaded here, or that commands each blade."""
    path, *rest = parse_names(controller)
    rest = [part if "=" in part else str(folder / part) for part in rest]
    if named_library(",".join([f"{DLL_PREFIX}{folder / path}", *rest])).pitch != PITCH[0]:
        raise InputError("pitch=individual: a board has one pitch for all blades")


def _inside(folder, name):
    """Return whether a name is a file directly in the folder, not a link."""
    path = folder / name
    return path.is_file() and not path.is_symlink() and path.resolve().parent == folder.resolve()


def _check_information(card, kind, problems):
    """Append problems of the declared inputs to `problems`."""
    if kind != PYTHON_FILE:
        if card.information is not None:
            problems.append(f"information: must be omitted for a {kind} controller, which declares inputs")
        return
    if card.information is None:
        problems.append("information is missing: the inputs of the controller")
        return
    strange = [name for name in card.information if name not in INPUTS]
    problems += [f"information: {unknown('input', name, INPUTS)}" for name in strange]
    times = f"preview_times = [{', '.join(f'{time:g}' for time in card.preview_times[:9])}]"
    if bool(card.preview_times) != ("wind_preview" in card.information):
        problems.append(f"{times}: must be set if and only if 'wind_preview' is in information")
    if list(card.preview_times) != sorted(set(card.preview_times)):
        problems.append(f"{times}: must increase")
    if len(card.preview_times) > MOST_TIMES or max(card.preview_times, default=0.0) > FURTHEST:
        problems.append(f"preview_times: must be at most {MOST_TIMES} times of at most {FURTHEST:g} s")
