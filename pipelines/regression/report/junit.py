"""A night as JUnit XML for a CI system: each data set is a suite, each figure a test case."""

import xml.etree.ElementTree as ET

from pipelines.regression.report.result import JudgedFigure, JudgedSet, NightResult
from schemas.base.errors import one_line


def junit_xml(night: NightResult) -> bytes:
    """Write a night as JUnit XML; a worse or missing figure is a failed test case, a set with a problem an error."""
    root = ET.Element("testsuites", name=one_line(f"footscan regress {night.suite}"))
    for judged_set in night.sets:
        root.append(_suite(judged_set, night))
    for attribute in ("tests", "failures", "errors"):
        root.set(attribute, str(sum(int(suite.get(attribute, "0")) for suite in root)))
    ET.indent(root)
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(root, "unicode").encode()


def _suite(judged_set: JudgedSet, night: NightResult) -> ET.Element:
    is_broken = judged_set.problem is not None
    suite = ET.Element(
        "testsuite",
        name=one_line(judged_set.name),
        tests=str(len(judged_set.figures) + is_broken),
        failures=str(judged_set.count("worse", "missing")),
        errors=str(int(is_broken)),
        timestamp=night.time.isoformat(timespec="seconds"),
    )
    if is_broken:
        case = ET.SubElement(suite, "testcase", classname=one_line(judged_set.name), name="run")
        ET.SubElement(case, "error", message=one_line(str(judged_set.problem)))
    for figure in judged_set.figures:
        case = ET.SubElement(suite, "testcase", classname=one_line(judged_set.name), name=one_line(figure.name))
        if figure.verdict in ("worse", "missing"):
            ET.SubElement(case, "failure", type=figure.verdict, message=one_line(_message(figure, judged_set)))
    return suite


def _message(figure: JudgedFigure, judged_set: JudgedSet) -> str:
    value = "missing" if figure.value is None else f"{figure.value:g}"
    accepted = "none" if figure.accepted is None else f"{figure.accepted:g}"
    steps = "; ".join(f"{', '.join(first.steps)}: {first.why}" for first in judged_set.first)
    return f"{figure.name}: {value}, accepted {accepted}, may differ by {figure.allowed:g}" + (
        f"; first step: {steps}" if steps else ""
    )
