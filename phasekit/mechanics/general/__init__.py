"""General mechanics: any rigid body that turns about an axis which itself turns about another.

Nothing in phasekit is computed with it. It is the papers' vector method as they state it
([HedrihVeljovic2011], [HedrihVeljovic2013]) for bodies of any shape and axes of any direction:
`RigidBody` with its mass moment vectors, and `CoupledRotation` with momenta, rotators and bearing
reactions. The disk's formulas in the room above are checked against it.
"""
