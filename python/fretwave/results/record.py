"""run.json: written with a checksum of its content, and believed only when it says what a run says."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from ..errors import InputError
from ..files.whole import replace_text
from ..texts import display

RECORD = "run.json"
CHECKSUM = "checksum"


class _Open(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True)


class _Case(_Open):
    path: str
    overrides: list[str]
    only: list[str]
    quick: bool
    petsc: str
    resolved: dict[str, Any]


class _Entry(_Open):
    status: str
    reason: str
    points: int
    wall_s: float


class _Sweep(_Open):
    over: dict[str, list[Any]]
    groups: int | None
    digests: list[str]


class _Study(_Open):
    arguments: list[str]


class _Record(_Open):
    run_id: str
    started: str
    status: str
    ranks: int
    selected: list[str]
    case: _Case
    analyses: dict[str, _Entry]
    sweep: _Sweep | None = None
    study: _Study | None = None
    part_of: str | None = None


def write_record(folder: Path, record: Mapping[str, Any]) -> None:
    """Write run.json in one step.

    Raises
    ------
    FileError
    """
    plain = json.loads(json.dumps({key: value for key, value in record.items() if key != CHECKSUM}))
    replace_text(folder / RECORD, json.dumps({**plain, CHECKSUM: _checksum(plain)}, indent=2) + "\n")


def read_record(folder: Path) -> dict[str, Any]:
    """run.json of a run folder.

    Raises
    ------
    InputError
        There is none, or it is damaged.
    """
    path = folder / RECORD
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        given = record.pop(CHECKSUM, None)
        if given is not None and given != _checksum(record):
            raise ValueError("its checksum is not that of its content")
        _Record.model_validate(record)
        return dict(record)
    except (FileNotFoundError, NotADirectoryError):
        raise _no_run(folder) from None
    except ValidationError as error:
        first = error.errors()[0]
        raise _damaged(path, f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from None
    except (ValueError, AttributeError, TypeError, KeyError, RecursionError) as error:
        raise _damaged(path, " ".join(str(error).split())) from None
    except OSError as error:
        raise InputError(
            "run.json cannot be read", display(path), error.strerror, fix="check who may read it"
        ) from None


def _damaged(path: Path, measured: str) -> InputError:
    fix = f"restore it from a copy, or run the case anew (a change made on purpose: remove its line {CHECKSUM})"
    return InputError("run.json is damaged", display(path), measured, "what the run wrote", fix)


def _no_run(folder: Path) -> InputError:
    inside = sorted(entry.parent for entry in folder.glob(f"*/{RECORD}")) if folder.is_dir() else []
    return InputError(
        "this is not a run folder",
        where=display(folder),
        measured="no run.json in it" if folder.is_dir() else "no such folder",
        expected="the folder of a run, for example runs/two_dof",
        fix=f"did you mean {display(inside[0])}?" if inside else "start a run with `fretwave run CASE`",
    )


def _checksum(record: Mapping[str, Any]) -> str:
    """Of all but the place of the case file, which a user may move and correct here."""
    case = {key: value for key, value in record["case"].items() if key != "path"}
    return f"{zlib.crc32(json.dumps({**record, 'case': case}, sort_keys=True).encode()):08x}"
