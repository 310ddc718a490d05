"""How far a record carries a verdict, as it is published: place, quantity, law."""

from ..evidence.pairs import function_in_words, named
from ..result import Result
from .cause import Number
from .dependence import Dependence, Standing


class Suffices(Result):
    """A function of one quantity at one place, times a known factor, with which the model stands by itself.

    Attributes
    ----------
    where : str
    quantity : str
        "n1" to "n3", inputs; two of them, their product; "alpha", "beta", "hours", "temperature", "sense" of approach
    factor : str or None
        what the function is multiplied by, another quantity; "tilt" where not the turn about an axis depends on it
    form : str
        how the function is written: in equal "pieces" of a line or "around" a circle, by "powers", "harmonics" up to an
        order, one "harmonic", a "jump", a "sawtooth", a "wave", "while" one move lasts, "values" where it has few
    complexity : int
        coefficients beside the model's, and one more for each number that was searched for
    radius : float
        least largest error over its bound that such a function leaves
    """

    where: str
    quantity: str
    factor: str | None
    form: str
    complexity: int
    radius: Number

    @staticmethod
    def of(standing: Standing) -> "Suffices":
        """What stands, as it is published."""
        pair = standing.pair
        return Suffices(
            where=pair.where,
            quantity=pair.quantity,
            factor=pair.factor or None,
            form=standing.form.kind,
            complexity=standing.complexity,
            radius=standing.radius,
        )

    @property
    def in_words(self) -> str:
        """Place and quantity in words."""
        return function_in_words(self.where, self.quantity, self.factor)

    @property
    def on(self) -> str:
        """The quantity with its factor, as a law begins with it."""
        return named(self.quantity, self.factor)


class Proven(Result):
    """What alone suffices, whatever the law: a place, and a quantity where nothing else would do.

    Attributes
    ----------
    place : str
    quantity, factor : str or None
        None where several quantities would do, or no function of one was found
    complexity : int or None
        of the least complex function of it that suffices
    same : tuple of str
        quantities that the record cannot tell from it
    not_excluded : tuple of str
        where no quantity is proven: those that would do
    """

    place: str
    quantity: str | None = None
    factor: str | None = None
    complexity: int | None = None
    same: tuple[str, ...] = ()
    not_excluded: tuple[str, ...] = ()

    @property
    def on(self) -> str | None:
        """The quantity with its factor, as a law begins with it."""
        return named(self.quantity, self.factor) if self.quantity else None

    @staticmethod
    def of(found: Dependence) -> "Proven | None":
        """What is proven; None where nothing is."""
        if found.place is None:
            return None
        first, names = found.proven, found.quantities
        if first is None:
            return Proven(place=found.place, not_excluded=names)
        pair = first.pair
        same = tuple(name for name in names if name != pair.name)
        return Proven(
            place=found.place,
            quantity=pair.quantity,
            factor=pair.factor or None,
            complexity=first.complexity,
            same=same,
        )
