"""The quantities that maps offer, of all systems or of one."""

from __future__ import annotations

from typing import Any

from phasekit.inputs import call_checked
from phasekit.systems.system import as_system
from phasekit.table.quantities import TABLE, Quantities


@call_checked
def quantities(system: Any = None) -> Quantities:
    """List what `sweep(of=...)` takes: quantities and groups of them, with units and meaning.

    Parameters
    ----------
    system : system, optional
        List what a map of this system takes: of equations rows by the names of the states. By
        default what the table has for any system.

    Returns
    -------
    Quantities
        A mapping of name to row; a row has ``group``, ``dims``, ``units``, ``long_name``,
        ``equation`` and ``source``. Printed, it is a table.

    Raises
    ------
    ParameterError
        If `system` is none.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.quantities()["winding_area"].units
    's-1'
    >>> "figure_eight" in pk.quantities().groups["separatrices"]
    True
    >>> logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 3.2}, map=True)
    >>> pk.quantities(logistic).groups["extrema"]
    ('min_x', 'max_x', 'mean_x', 'min_x_error', 'max_x_error')
    """
    if system is None:
        return Quantities()
    found = as_system(system)
    where, law = found.standing, found.own_equations
    rows = {}
    if law is None:
        rows = {n: row for n, row in TABLE.offered.items() if TABLE.offers(where, row.group)}
        if where.traits is None:
            return Quantities(rows)
        law = found.equations()
    from phasekit.cells.equations import table_of  # here: it loads sympy

    return Quantities({**table_of(found, law).offered, **rows})
