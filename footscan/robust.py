"""Scale of residuals among which some are wrong."""

MAD_TO_SD = 1.4826
"""Standard deviation of a normal distribution over the median of its absolute deviations: 1 / Phi^-1(3/4)."""
