"""Constants: each with unit, reason, and what changing it costs."""

MASS_UNIT = 1e-15
"""[kg] Mass is counted in whole units of this, in int64, so that the ledger closes exactly.
A particle of 2.5 mm is 1.6e10 units; int64 ends at 9,223 kg. Larger units would round the wetting."""

GRAVITY = 9.81
"""[m/s^2] Default; a scene sets its own vector."""

AIR_DENSITY = 1.2
"""[kg/m^3] At 20 C and 1013 hPa."""
