"""Results with something in every field that a page shows, and pages as plain text to compare them with."""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

MOST_VALUES = 12  # of a row of numbers that is shown as it is
LONG = 60  # characters or values: on a line by itself


def value(number: float, unit: str = "N.m", **more: Any) -> dict[str, Any]:
    return {"value": number, "standard_error": 0.01 * number, "unit": unit} | more


PARAMETER = value(3300.0, nominal=3000.0, interval=[3280.0, 3320.0])
MISFIT = {"nominal": 0.1, "parameters": 0.05, "final": 0.001, "noise": 0.0005, "unit": "rad"}
TESTED = {"source": "a.csv", "rows": 60, "worse": True, "r_squared": {"theta_m": 0.99},
          "misfit": {"theta_m": MISFIT, "theta_l": MISFIT | {"noise": None}, "omega_m": MISFIT | {"nominal": None}},
          "torque_left": {"nominal": 0.5, "parameters": 0.25, "final": 0.125}}  # fmt: skip
FRICTION = {"name": "coulomb_friction", "site": "motor", "grade": "certain", "gain": 0.5, "t": 12.0,
            "parameters": {"torque": value(0.8), "start": value(0.1, "1", interval=[0.09, 0.11]),
                           "end": {"value": None}, "bare": {"value": 2.0, "unit": "s"}},
            "explains": {"torque": 0.9, "motion": 0.75}, "family": ["stribeck_friction@load"],
            "lowered_by": ["short_record"], "in_model": False}  # fmt: skip
FOLLOWS = [{"site": "motor", "argument": "speed", "share": 0.3, "gain": 0.2, "t": 5.0, "formula": "a x"},
           {"site": "load", "argument": "angle", "share": None, "gain": None, "t": None}]  # fmt: skip
STEPS = [{"on_top_of": [], "taken": "backlash@shaft", "tried": [{"effect": "backlash@shaft", "gain": 0.5, "t": 9.0}]},
         {"on_top_of": ["backlash@shaft"], "taken": "",
          "tried": [{"effect": "drag@load", "gain": 0.01, "t": 1.0}]}]  # fmt: skip
LAW = {"site": "motor", "argument": "speed", "argument_unit": "rad/s", "unit": "N.m", "words": "it grows",
       "knots": [0.0, 1.0], "values": [0.0, 2.0], "band": [[-0.1, 1.9], [0.1, 2.1]], "formula": "2 x", "gain": 0.3,
       "t": 6.0}  # fmt: skip
RED = {"level": "amber", "reasons": ["the record is short"]}
LIVE = {"fmu": "Drivetrain", "step": 0.5, "rows": [0, 3], "starts": [{"theta_m_start": 0.1}, {"theta_m_start": 0.2}],
        "values": {"k": 3300.0, "effects.coulomb_friction.motor.torque": 0.8, "effects.torque_ripple.phase": 0.3,
                   "effects.stribeck_friction.motor.stribeck_speed": 2.0}}  # fmt: skip
RECORD = "time,u,theta_m,theta_m_after,theta_l,contact\n" + "".join(
    f"{0.5 * n},{(-1) ** n * 2.0},{n},{n + 0.5},{0.25 * n},{contact}\n" for n, contact in enumerate((1, 0, 0, -1, 0, 0))
)
METHODS = {
    "maximum_likelihood": value(0.02, "rad", alpha=0.02, cramer_rao=1e-4, interval=[0.0199, 0.0201], visible=True)
    | {"trust": RED, "message": "it is seen", "diagnostics": {"converged": True, "more": {"x": 1}, "parameters": {}}},
    "ekf": {"alpha": 0.003, "standard_error": 1e-3, "interval": [0.001, 0.004], "visible": True, "diagnostics": {}},
    "paired_sum": {"alpha": 0.0, "interval": [0.0, 0.01], "visible": False},
    "torque_pulse": {"not_applicable": "no pulses"},
}
EXCITATIONS = [{"name": "multisine", "bound": 1e-4, "peak_torque": 8.0, "peak_motor_speed": 40.0}]
ESTIMATE = METHODS["maximum_likelihood"] | {
    "method": "maximum_likelihood", "record": {"rows": 6, "step": 0.5, "source": "a.csv"}, "estimates": METHODS,
    "repeats": {"sources": ["a.csv", "b.csv"], "floor": {"theta_m": 1e-4, "theta_l": 2e-4}}, "live": LIVE,
    "diagnosis": {"verdict": "effects", "effects": [FRICTION]}, "design": EXCITATIONS, "diagnostics": {
        "profile_limit": 6.5, "measurement_noise": [9e-5], "parameters": {"k": PARAMETER}},
}  # fmt: skip
PROFILE = "alpha,drop\n0.0199,4\n0.02,0\n0.0201,4\n"
FLANKS = "time,twist,flank\n0,-0.02,-1\n1,0,0\n2,0.02,1\n"
INSPECT = {
    "record": {"rows": 400, "step": 0.005, "source": "a.csv", "missing": 3, "notes": ["CSV, separator `;`"]},
    "channels": [{"name": "u", "unit": "N.m", "least": -2.0, "most": 2.0, "count": 0.0, "noise": 0.1,
                  "saturated": 0.25, "missing": 3}],
    "excitation": [{"low": 0.0, "high": 2.0, "share": 0.756789, "coherence": 0.9}],
    "reversals": {"torque": 12, "motor_speed": 10}, "delay": {"value": 0.0105, "standard_error": 0.00025},
    "smallest_gap": 0.0123, "gaps": [{"half_gap": 0.01, "bound": 1e-3, "seen": True}],
    "effects": [{"name": "friction", "smallest": 0.1, "unit": "N.m"}], "better_experiments": EXCITATIONS,
    "assumed": ["`u` is in N.m"], "verdict": ["A gap would show.", "So would friction."],
}  # fmt: skip
FINDING = {"severity": "error", "rule": "unit.factor", "path": "m.xml", "message": "no", "advice": "yes"}
CHECK = {"ok": False, "counts": {"error": 1, "warning": 0, "info": 2}, "fmus": [
    {"fmu": "a/bad.fmu", "ok": False, "counts": {"error": 1, "warning": 0, "info": 0}, "facts": {"fmiVersion": "2.0"},
     "findings": [FINDING, FINDING | {"known": True, "message": "known"}], "not_executed": "as was asked",
     "rules": [{"rule": "unit.factor", "outcome": "failed"}, {"rule": "xml.encoding", "outcome": "passed"}]},
    {"fmu": "good.fmu", "ok": True, "executed": True, "counts": {"error": 0, "warning": 0, "info": 2}},
]}  # fmt: skip
LOOPS = "time,reference,contact,theta_l,twin_theta_l,theta_m,twin_theta_m,u,twin_u,theta_l_hat,twin_theta_l_hat\n" + (
    "".join(f"{0.001 * n},0,{n % 2},{n},0,{n},0,2,1,{'' if n == 1 else n},0.5\n" for n in range(4))
)
SIGNALS = [{"signal": f"a.x{n}", "unit": unit} for n, unit in enumerate(("m", "m", "m", "m", "m", "m", "m", "", "s"))]
SCENARIO = "time,a.x0,a.x1,a.x2,a.x3,a.x4,a.x5,a.x6,a.x7\n0,0,1,2,3,4,5,6,7\n0.5,0,1,2,3,4,5,6,\n"
SWEEP = "case,noise,repetition,alpha,status,S,estimate,lower,upper,error,error_percent,message\n" + "".join(
    f"{n},0.0,1,{a},done,0.1,{a},{0.9 * a},{1.1 * a},0.0,0.0,\n" for n, a in enumerate((0.01, 0.02, 0.08))
)
# Page: command, arguments, results, further files.
PAGES: dict[str, tuple[str, dict[str, Any], dict[str, Any], dict[str, str]]] = {
    "estimate": ("estimate", {"method": "all"}, ESTIMATE,
                 {"estimate.csv": RECORD, "profile.csv": PROFILE, "flanks.csv": FLANKS, "design.csv": "time,u\n0,1\n"}),
    "undiagnosed": ("estimate", {}, ESTIMATE | {"diagnosis": None, "undiagnosed": "too short", "live": LIVE | {
        "step": 20.0, "rows": [1, 4]}}, {"estimate.csv": RECORD}),
    "diagnose": ("diagnose", {}, {
        "verdict": "effects", "effects": [FRICTION], "nuisances": [FRICTION], "parameters": {"k": PARAMETER, "c": {}},
        "test": [TESTED], "validation": TESTED | {"source": "b.csv", "worse": False}, "remaining": {
            "torque": {"motor": 0.25, "load": None}, "follows": FOLLOWS}, "learned_law": LAW, "analysis": [
            {"source": "a.csv", "rate": 200.0, "rows": 40, "rows_of_the_file": 5, "band": {"motor": 12.0}}],
        "trust": RED, "model": "corrected.fmu", "notes": ["it is late"], "candidates": STEPS, "summary": ["Yes."],
        "cosimulation": {"largest_difference_from_compiled": 1e-9, "unit": "rad"}, "live": LIVE, "odd": {"x": 1},
    }, {"diagnose.csv": RECORD}),
    "diagnose a slide": ("diagnose", {}, {"verdict": "none", "test": [TESTED | {"misfit": {
        "theta_m": MISFIT | {"unit": "m"}}}], "live": LIVE | {"fmu": "ServoAxis", "values": {}}},
        {"diagnose.csv": "time,u,theta_m\n0,1,2\n0.5,-1,\n1,1,3\n1.5,0,4\n"}),
    "any FMU": ("diagnose", {}, {
        "kind": "fmu", "verdict": "effects", "effects": [FRICTION], "parameters": {"k": PARAMETER}, "test": [TESTED],
        "validation": TESTED, "remaining": {"outputs": {"y": 0.25, "z": None}, "follows": FOLLOWS}, "runs": 9,
        "candidates": STEPS, "walls": "own process", "seconds": 3.0, "notes": ["it is late"], "trust": RED,
        "delivery": [{"file": "corrected.ssp", "parts": [{"name": "a", "effect": "b"}], "note": "c"}], "odd": {"x": 1},
    }, {}),
    "inspect": ("inspect", {}, INSPECT, {}),
    "inspect without": ("inspect", {}, INSPECT | {"delay": None, "smallest_gap": None, "assumed": []}, {}),
    "check": ("check", {}, CHECK, {}),
    "pair": ("simulate", {"start": {"plant.effects.load_torque.torque": 8.0}}, {
        "alpha": 0.02, "S": 1.0, "crossings": 3, "estimate": {"alpha": 0.0201, "lower": 0.02, "upper": None},
        "experiment": {"duration": 0.003}}, {"simulate.csv": LOOPS}),
    "pair without weight": ("simulate", {}, {
        "alpha": 0.0, "S": 0.0, "experiment": {"duration": 0.003, "state_weights": [0.0, 1.0, 2.0, 3.0, 4.0]},
        "no_estimate": "S is too small"}, {"simulate.csv": LOOPS}),
    "pair cut short": ("simulate", {}, {"alpha": 0.02, "S": 0.0, "experiment": {"duration": 0.009}},
                       {"simulate.csv": LOOPS}),
    "scenario": ("simulate", {}, {"signals": SIGNALS, "steps": 1, "events": {}}, {"simulate.csv": SCENARIO}),
    "ssp": ("ssp", {"file": "in/a.ssp"}, {"signals": SIGNALS, "steps": 1}, {"ssp.csv": SCENARIO}),
    "ssp without arguments": ("ssp", {}, {"file": "in/b.ssp", "signals": SIGNALS[:1], "steps": 0},
                              {"ssp.csv": SCENARIO}),
    "sweep": ("sweep", {"sizes": "3"}, {
        "cases": 3, "failed": 0, "columns": [
            {"name": name, "unit": "rad"} for name in SWEEP.split("\n")[0].split(",")[5:11]],
        "statistics": [
            {"noise": 0.0, "count": 3, "mean_percent": 1.0, "worst_percent": 2.0, "mse": 1e-9, "coverage": 0.9}],
        "experiment": {"duration": 2.0, "values": {"k": 3300.0}}, "fmus": {"Drivetrain": "ab"}}, {"sweep.csv": SWEEP}),
    "sweep calibrated": ("sweep", {}, {
        "cases": 3, "failed": 0, "calibrations": {"0": {"digest": "abc", "runs": 10}}},
        {"sweep.csv": SWEEP.replace("0.08", "0.2")}),
}  # fmt: skip


def outline(part: Any, depth: int = 0) -> list[str]:
    """Return a report as lines: what each part holds, of long rows of numbers the ends and the sum."""
    pad, short, lines = "  " * depth, [], []
    for entry in fields(part):
        content = getattr(part, entry.name)
        if isinstance(content, np.ndarray):
            content = [None if np.isnan(value) else value for value in content.tolist()]
        if entry.default == content and type(entry.default) is type(content):
            continue
        items = [content] if is_dataclass(content) else content
        if isinstance(items, (list, tuple)) and items and is_dataclass(items[0]):
            lines += [f"{pad}  {entry.name}:", *(line for item in items for line in outline(item, depth + 2))]
        elif isinstance(content, tuple) and content and isinstance(content[0], tuple):
            lines += [f"{pad}  {entry.name}:", *(f"{pad}    {_text(item)}" for item in content)]
        elif isinstance(content, Sequence) and len(content) > LONG:
            lines.append(f"{pad}  {entry.name}: {_text(content)}")
        else:
            short.append(f"{entry.name} {_text(content)}")
    return [f"{pad}{type(part).__name__}: {'; '.join(short)}", *lines]


def _text(content: Any) -> str:
    if isinstance(content, float):
        return f"{content:.6g}"
    if isinstance(content, Path):
        return content.name
    if isinstance(content, bytes) or not isinstance(content, Sequence) or isinstance(content, str):
        return repr(content)
    if len(content) > MOST_VALUES and all(isinstance(item, (int, float)) for item in content):
        return f"{len(content)} numbers, {_text(content[0])} to {_text(content[-1])}, sum {sum(content):.6g}"
    return f"({', '.join(_text(item) for item in content)})"
