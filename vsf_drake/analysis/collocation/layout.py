"""What one instant's variables are, and where each of them stands."""

from __future__ import annotations

from dataclasses import dataclass

from vsf_drake.errors import InputError

KINDS = ("q", "v", "a", "w", "u", "s")


@dataclass(frozen=True)
class Layout:
    """z = [q (n), v (n), a (n), w (k), u (k), s (e)] of one instant, Z = 3n + 2k + e.

    Attributes:
        coordinates: names (n,) of the coordinates q; v and a are their first and second time derivatives.
        quasi_static: names (k,) of the variables w that are in equilibrium at every instant; u are their rates.
        extra: names (e,) of free variables s of the instant, e.g. a torque.

    Raises:
        InputError: a name appears twice.
    """

    coordinates: tuple[str, ...]
    quasi_static: tuple[str, ...] = ()
    extra: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("coordinates", "quasi_static", "extra"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        every = (*self.coordinates, *self.quasi_static, *self.extra)
        twice = [name for name in every if every.count(name) > 1]
        if twice:
            raise InputError(f"{twice[0]!r} appears twice", where="layout", right="Names must differ")

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @property
    def k(self) -> int:
        """Number of quasi-static variables."""
        return len(self.quasi_static)

    @property
    def size(self) -> int:
        """Z, number of variables of an instant."""
        return 3 * self.n + 2 * self.k + len(self.extra)

    @property
    def q(self) -> slice:
        """Coordinates, columns of z."""
        return slice(0, self.n)

    @property
    def v(self) -> slice:
        """Velocities, columns of z."""
        return slice(self.n, 2 * self.n)

    @property
    def a(self) -> slice:
        """Accelerations, columns of z."""
        return slice(2 * self.n, 3 * self.n)

    @property
    def w(self) -> slice:
        """Quasi-static variables, columns of z."""
        return slice(3 * self.n, 3 * self.n + self.k)

    @property
    def u(self) -> slice:
        """Rates of the quasi-static variables, columns of z."""
        return slice(3 * self.n + self.k, 3 * self.n + 2 * self.k)

    @property
    def s(self) -> slice:
        """Free variables, columns of z."""
        return slice(3 * self.n + 2 * self.k, self.size)

    @property
    def names(self) -> tuple[str, ...]:
        """(Z,) "kind.name" of every column, e.g. "v.hip"."""
        of = {"q": self.coordinates, "v": self.coordinates, "a": self.coordinates, "w": self.quasi_static,
              "u": self.quasi_static, "s": self.extra}
        return tuple(f"{kind}.{name}" for kind in KINDS for name in of[kind])

    def column(self, kind: str, name: str) -> int:
        """Column of z of one variable, e.g. column("v", "hip").

        Raises:
            InputError: there is none of that kind and name.
        """
        try:
            return self.names.index(f"{kind}.{name}")
        except ValueError:
            raise InputError(f"there is no {kind}.{name}", where="layout",
                             right=f"There are: {', '.join(self.names)}") from None
