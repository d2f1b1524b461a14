"""The state of a trace: all that it needs to go on as if it had never stopped.

It stands at the head of the work array: seven vectors of unknowns, eight numbers, and the vector l
of a Hopf curve (see `phasekit.bifurcation.continuation.kernels.defining`).
"""

VECTORS = 7
POINT, TANGENT, BEFORE, SCALE, WEIGHT, START, START_TANGENT = range(VECTORS)

# Next step, last step (0: none that counts), arclength, points so far, the sign of the determinant
# at the last point (0: not known) and of the last matrix, and what Newton's second step was in
# units of the square of its first.
NUMBERS = 8
NEXT, LAST, LENGTH, DONE, SIDE, SIGN, QUADRATIC = range(7)
