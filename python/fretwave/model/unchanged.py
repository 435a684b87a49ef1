"""Whether contacts are still what a model took them for: its laws do not follow parameters that change afterwards."""

from __future__ import annotations

from hashlib import blake2b

import numpy as np

from ..arrays import AnyArray
from ..errors import InputError
from ..texts import shortened
from .contact import Contact
from .sectors import by_sector, real_csr

#: Bytes of what B is told by.
DIGEST = 16


class Taken:
    """A contact as it was when its model was made: its parameters, and what tells its B from another."""

    def __init__(self, contact: Contact) -> None:
        self.contact, self._law, self._B = contact, contact.law, _digest(contact)
        self._parameters = {name: np.array(value) for name, value in contact.parameters.items()}

    def check(self) -> None:
        """It is the same now.

        Raises
        ------
        InputError
            The model would answer for what the contact was.
        """
        now = {name: np.asarray(value) for name, value in self.contact.parameters.items()}
        names = sorted(name for name in now.keys() | self._parameters.keys() if not self._same(name, now))
        measured, expected = "another law or B", "the law and B that the model took"
        if names:
            measured, expected = (f"{names[0]} = {_said(given.get(names[0]))}" for given in (now, self._parameters))
            expected += ", as the model took it"
        elif self._same_law() and _digest(self.contact) == self._B:
            return
        where, fix = f"contact '{self.contact.name}'", "make the model again: fw.Model(M, K, contacts=[contact])"
        raise InputError("a contact has changed since its model was made", where, measured, expected, fix)

    def _same_law(self) -> bool:
        now = self.contact.law
        return now is self._law or (isinstance(now, str) and now == self._law)

    def _same(self, name: str, now: dict[str, AnyArray]) -> bool:
        if name not in now or name not in self._parameters:
            return False
        try:
            one, other = np.broadcast_arrays(now[name], self._parameters[name])
        except ValueError:
            return False
        return bool(np.all((one == other) | ((one != one) & (other != other))))  # nan too


def _said(value: AnyArray | None) -> str:
    return "nothing" if value is None else shortened(str(value))


def _digest(contact: Contact) -> bytes:
    """Of the entries of B."""
    found = blake2b(digest_size=DIGEST)
    for k, B in by_sector(contact.B).items():
        rows = real_csr(B).copy()
        rows.eliminate_zeros()
        for part in (np.array([k, *rows.shape]), rows.indptr, rows.indices, rows.data):
            found.update(np.ascontiguousarray(part).tobytes())
    return found.digest()
