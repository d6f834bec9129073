"""Scale of residuals among which some are wrong."""

MAD_TO_SD = 1.4826
"""Standard deviation of a normal distribution over the median of its absolute deviations: 1 / Phi^-1(3/4)."""
TUKEY = 4.685
"""Residual, in standard deviations, from which an observation has no weight by Tukey's biweight: 95 % efficiency for
normal errors (A. E. Beaton and J. W. Tukey, Technometrics 16(2), 1974, doi:10.1080/00401706.1974.10489171)."""
