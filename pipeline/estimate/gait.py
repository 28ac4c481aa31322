"""What walking does to a person's height in the picture."""

from __future__ import annotations

# The head rises and falls by 46 mm from lowest to highest, twice a stride (Whittle, Gait Analysis:
# vertical excursion of the trunk): a sine of 16 mm standard deviation.
EXCURSION_M = 0.046
GAIT_STD_M = EXCURSION_M / 2 / 2**0.5
# At its highest, over the standing leg, a walker's head is about 1 cm below its height when standing
# still, since that knee stays bent; so on average it is by that and half the excursion lower. How much
# differs by person and pace; half of it is taken as the standard deviation.
STANCE_KNEE_M = 0.01
GAIT_DROP_M = STANCE_KNEE_M + EXCURSION_M / 2
GAIT_DROP_STD_M = GAIT_DROP_M / 2
# Slower than this nobody walks: it is standing about (a slow walk is 0.8 m/s).
WALKING_FROM_M_S = 0.4
