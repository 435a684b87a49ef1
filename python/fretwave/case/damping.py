"""``[damping]`` of a case: its three forms as one, its checks, and what it adds to C."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Union

import scipy.sparse as sp

from ..errors import InputError
from ..model.contact import in_limit
from ..model.modal_damping import LARGEST, Ratios, check_size, modal_damping
from ..model.sectors import Sparse
from ..model.wheel_matrix import WheelMatrix
from ..texts import toml
from .reporter import Found, Reporter
from .schema import DampingSection, ReductionSection
from .toml.source import Source

if TYPE_CHECKING:
    from ..model.contact import Contact
    from ..model.structure import Structure

#: zeta from each form.
FORMS: Mapping[str, Callable[[float], float]] = {
    "zeta": lambda given: given,
    "Q": lambda given: 0.5 / given,
    "loss_factor": lambda given: 0.5 * given,
}
#: Entries of C of a wheel, 12 bytes each, over those of a sector's terms.
OF_A_WHEEL = 5


def ratios_of(section: DampingSection) -> Ratios:
    """Damping ratios, in whichever form they are given."""
    for name, zeta in FORMS.items():
        given = getattr(section, name)
        if isinstance(given, dict):
            return {int(number): zeta(value) for number, value in given.items()}
        if isinstance(given, list):
            return [zeta(value) for value in given]
        if given is not None:
            return float(zeta(given))
    return 0.0


def damping_line(section: DampingSection) -> str:
    """In words, for ``fretwave check``."""
    form = next(name for name in FORMS if getattr(section, name) is not None)
    given = getattr(section, form)
    ratios = "" if form == "zeta" else f" (zeta {_as_zeta(form, given)})"
    of = "all modes" if isinstance(given, float) else "these modes"
    return f"damping of {of} with contact {section.contact}: {form} = {toml(given)}{ratios}"


def _as_zeta(form: str, given: Union[float, list[float], dict[str, float]]) -> str:
    """A value of a form as damping ratio, as TOML writes it."""
    if isinstance(given, dict):
        return toml({number: float(f"{FORMS[form](value):.6g}") for number, value in given.items()})
    if isinstance(given, list):
        return toml([float(f"{FORMS[form](value):.6g}") for value in given])
    return f"{FORMS[form](given):.6g}"


def damping_by_mode(
    section: DampingSection, structure: Structure, contacts: Sequence[Contact], where: str
) -> dict[int, Sparse]:
    """What it adds to C of a structure or a tied sector, on the sector k places ahead.

    Parameters
    ----------
    where : it stands in the case
    """
    limit = in_limit(contacts, section.contact)
    try:
        return modal_damping(structure.M, structure.K, ratios_of(section), limit, structure.sectors)
    except InputError as error:
        place = ", ".join(filter(None, (where, error.where)))
        raise InputError(error.what, place, error.measured, error.expected, error.fix) from None


def around_wheel(terms: Mapping[int, Sparse], sectors: int) -> dict[int, WheelMatrix]:
    """The same of the whole wheel.

    Raises
    ------
    InputError
        Every sector is tied to so many others that their matrix is not to be made.
    """
    entries = sectors * sum(sp.csr_matrix(C).nnz for C in terms.values())
    if entries > OF_A_WHEEL * LARGEST:
        fix = "reduce the sector further, or damp the wheel with stiffness_damping and mass_damping"
        what = "damping by mode ties all sectors of the wheel to each other"
        raise InputError(what, "[damping]", f"{entries} entries", f"at most {OF_A_WHEEL * LARGEST}", fix)
    return {0: WheelMatrix(terms, sectors)}


def check_damping(
    source: Source,
    section: DampingSection | None,
    structure: Structure | None,
    reduction: ReductionSection | None,
    notes: list[str],
    found: Found,
) -> None:
    """One form, numbers of modes, and a model that its full matrices are made of."""
    if section is None:
        return
    if section.contact == "stuck" and any(isinstance(getattr(section, name), float) for name in FORMS):
        notes.append(
            "[damping] of all modes with contact stuck damps slip too, for some of them are the contact's own springs;"
            " the linear modes' zeta with contact sliding says how much"
        )
    report = Reporter(source, ("damping",), found)
    _check_forms(report, section)
    for name in FORMS:
        given = getattr(section, name)
        for number in given if isinstance(given, dict) else ():
            if not (number.isdecimal() and 0 < int(number) < 10**9):
                report.wrong(
                    (name, number), "is of no mode", "the number of a mode, 1 is the lowest", "write `1 = ...`"
                )
    if structure is not None and (reduction is None or reduction.error_at is not None):
        _check_size(report, structure, reduction)


def _check_forms(report: Reporter, section: DampingSection) -> None:
    given = [name for name in FORMS if getattr(section, name) is not None]
    if not given:
        where, fix = report.source.where(report.path), "add for example `zeta = 0.002`"
        report.found.append(InputError("[damping] damps nothing", where, None, "zeta, Q or loss_factor", fix))
    for other in given[1:]:
        first, second = (_as_zeta(name, getattr(section, name)) for name in (given[0], other))
        said = f"one of zeta, Q and loss_factor: {given[0]} is zeta {first}, {other} is zeta {second}"
        report.wrong((other,), f"is given beside {given[0]}", said, f"remove `{other}`")


def _check_size(report: Reporter, structure: Structure, reduction: ReductionSection | None) -> None:
    """Where the model is not reduced, or where its error against the unreduced one is asked for."""
    try:
        check_size(structure.n_dof, structure.sectors)
    except InputError as problem:
        path = report.path if reduction is None else ("reduction", "error_at")
        fix = problem.fix if reduction is None else "remove error_at, or take stiffness_damping in place of [damping]"
        where = report.source.where(path)
        report.found.append(InputError(problem.what, where, problem.measured, problem.expected, fix))
