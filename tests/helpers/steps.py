"""Kinds of steps, as plans list them."""

LEFT_BY_A_SEARCH = {
    "measure", "sizes.json", "quality.json", "cloud.ply", "foot.stl", "foot.ply", "pictures", "deviations", "report",
}  # fmt: skip
"""Those that a search for parameters does not run, of a scan without background and truth."""
