"""Continuation with labels: branches, special points, diagrams, and the files they are kept in."""

from phasekit.labelled.continuation.onward import lead

lead(
    {
        "branch.save": "phasekit.labelled.continuation.branch_store:save",
        "branch.load": "phasekit.labelled.continuation.branch_store:load",
        "point.switch": "phasekit.labelled.continuation.point_curves:leave",
        "point.curve": "phasekit.labelled.continuation.point_curves:point_curve",
        "point.sensitivity": "phasekit.labelled.continuation.sensitivity:of_equilibrium",
        "large.switch": "phasekit.labelled.continuation.large_start:switch",
        "large.sensitivity": "phasekit.labelled.continuation.large_start:sensitivity",
        "large.curve": "phasekit.labelled.continuation.large_start:point_curve",
        "orbit.switch": "phasekit.labelled.continuation.cycle_codimension_two:leave",
        "orbit.sensitivity": "phasekit.labelled.continuation.sensitivity:of_orbit",
        "connection": "phasekit.labelled.continuation.connection:connection",
        "connection.curve": "phasekit.labelled.continuation.connection:curve",
        "orbit.curve": "phasekit.labelled.continuation.cycle_onward:point_curve",
    }
)
