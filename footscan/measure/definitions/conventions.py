"""The published definition that each measure follows, its name in ISO standards, and where ours differs from them.

The ISO texts are not free. What is said of them here comes from published summaries and from national standards that
adopt them, and was not checked against the texts themselves.
"""

from schemas.measures import Convention

_ANSUR = "ANSUR II (Gordon and others 2014)"
_INFOOT = "INFOOT (I-Ware Laboratory)"
_JIS = "JIS S 5037, as AIST describes it"
_LASTS = "shoemakers' lasts"
_AHI = "arch height index (Williams and McClay 2000)"
_SKIN = "the place is found from the form of the skin; nobody feels for the bone"

OWN = Convention(follows="footscan")
"""Of a measure for which we know of no published definition."""

CONVENTIONS: dict[str, Convention] = {
    "foot_length": Convention(
        follows=f"{_JIS}: foot length",
        iso="ISO 7250-1, ISO 20685-1: foot length",
        iso_differs="the foot's axis is fixed here: from the rearmost heel point to the tip of the second toe, or as "
        "`axis` says",
    ),
    "foot_breadth": Convention(
        follows="ISO 9407, as GB/T 3293.1 has it: foot width",
        iso="ISO 9407: foot width",
        iso_differs=f"not the foot breadth of ISO 7250-1, which is `foot_breadth_max`; {_SKIN}",
    ),
    "foot_breadth_max": Convention(
        follows="ISO 7250-1: foot breadth",
        iso="ISO 7250-1, ISO 20685-1: foot breadth",
        iso_differs="sought at 55 to 85 % of the foot length only, at right angles to `axis`",
    ),
    "ball_length": Convention(follows="Brannock device: heel-to-ball length"),
    "bimalleolar_breadth": Convention(follows=f"{_ANSUR}: bimalleolar breadth"),
    "lateral_malleolus_height": Convention(follows=f"{_ANSUR}: lateral malleolus height"),
    "instep_height": Convention(follows=f"{_AHI}: dorsal height at half the foot length"),
    "arch_height_index": Convention(follows=f"{_AHI}; the load is that of `posture`, theirs is seated and standing"),
    "toe_1_angle": Convention(follows=f"{_INFOOT}: toe #1 angle"),
    "toe_5_angle": Convention(follows=f"{_INFOOT}: toe #5 angle"),
    "ball_girth": Convention(follows=f"{_JIS}: foot circumference"),
    "straight_ball_girth": Convention(follows=f"{_LASTS}: straight ball girth"),
    "waist_girth": Convention(follows=f"{_LASTS}: waist girth"),
    "instep_girth": Convention(follows=f"{_INFOOT}: instep circumference"),
    "instep_girth_min": Convention(follows=f"{_LASTS}: instep girth"),
    "heel_girth": Convention(follows=f"{_INFOOT}: heel girth"),
    "long_heel_girth": Convention(follows=f"{_LASTS}: long heel girth"),
    "ankle_girth": Convention(follows=f"{_ANSUR}: ankle circumference"),
    "arch_index": Convention(follows="Cavanagh and Rodgers 1987: arch index"),
    "chippaux_smirak_index": Convention(follows="Chippaux 1947 and Smirak 1960: index"),
    "staheli_index": Convention(follows="Staheli and others 1987: arch index"),
    "clarke_angle": Convention(follows="Clarke 1933: footprint angle"),
}
"""By the name of the measure; those that are not listed are `OWN`."""
