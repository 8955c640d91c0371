"""Spellings of units as logs have them, and what each must mean: the table of truth of the tests of units.

Values are written out from their definitions (1 lbf = 4.4482216152605 N, 1 in = 0.0254 m, 1 kgf = 9.80665 N), not taken
from the library. None: no reader may take the text as anything.
"""

import math

DEG = math.pi / 180.0
TURN = 2.0 * math.pi
INCH, FOOT = 0.0254, 0.3048
LBF = 4.4482216152605
OZF = LBF / 16.0
KGF = 9.80665

# Spellings (separated by `|`), and factor to SI in a column of that kind. Percent: 1.0 is one percent.
KNOWN = {
    "torque": [
        ("Nm|N.m|N m|N-m|N*m|N·m|N⋅m|NM|nm|newton meter|newton-metre|Newtonmeter|n.m|N•m|m.N", 1.0),
        ("mNm|mN.m|mN m|mN·m|mnm|mN-m|1e-3 N.m|10^-3 Nm|0.001 Nm", 1e-3),
        ("Nmm|N.mm|N mm|N-mm|N·mm|nmm|NMM|newton millimeter", 1e-3),
        ("Ncm|N.cm|N-cm|cNm|0.01 Nm|0,01 Nm", 1e-2),
        ("kNm|kN.m|kN·m|KNm", 1e3),
        ("MNm", 1e6),
        ("uNm|µNm|μNm", 1e-6),
        ("lb-in|lbf-in|lbf.in|in-lb|in-lbf|inlb|lb in|lb·in|inch-pounds", LBF * INCH),
        ("ft-lb|lbf-ft|ft-lbf|lbf ft|ft.lbf|foot pounds|lb-ft", LBF * FOOT),
        ("ozf-in|oz-in|oz in|ozf.in|in-oz|ozin", OZF * INCH),
        ("kgf.cm|kgf-cm|kgfcm|kp.cm", KGF * 1e-2),
        ("kgf.m|kgf m|kp.m", KGF),
    ],
    "force": [("N|newton", 1.0), ("kN|KN", 1e3), ("mN", 1e-3), ("lbf", LBF), ("kgf", KGF), ("daN", 10.0)],
    "current": [("A|Arms|A_rms|A rms|Amp|ampere|A(rms)", 1.0), ("mA|milliamps", 1e-3)],
    "voltage": [("V|volt|Volts", 1.0), ("mV", 1e-3), ("kV", 1e3)],
    "share": [
        ("%|percent|pct|Prozent", 1.0),
        ("0.1 %|0.1%|0,1 %|‰|permille|per mille|0.1 percent", 0.1),
        ("0.01 %|0.01%", 0.01),
        ("p.u.|pu|per unit|1|-", 100.0),
    ],
    "angle": [
        ("rad|Rad|RAD|radian|radians|rads", 1.0),
        ("mrad|1e-3 rad|0.001 rad|millirad", 1e-3),
        ("urad|µrad", 1e-6),
        ("deg|°|º|degree|degrees|Deg|DEG|Grad", DEG),
        ("0.1 deg|0.1deg|0.1°|0,1 °|1/10 deg|0.1 degree", 0.1 * DEG),
        ("mdeg|0.001 deg", 1e-3 * DEG),
        ("rev|revs|revolution|revolutions|rot|rotations|rotation|turn|turns|U|Umdr|Umdrehungen", TURN),
        ("1/4096 rev|1/4096 turn", TURN / 4096.0),
        ("gon|gradian", TURN / 400.0),
        ("arcmin", DEG / 60.0),
        ("arcsec", DEG / 3600.0),
    ],
    "length": [
        ("m|meter|metres", 1.0), ("mm|millimeter", 1e-3), ("um|µm|micron", 1e-6), ("cm", 1e-2), ("in|inch", INCH),
        ("ft", FOOT), ("0.1 mm|1/10 mm", 1e-4), ("km", 1e3),
    ],
    "counts": [
        ("counts|count|cts|cnt|cnts|inc|incr|Inc|INC|increments|Inkr|Inkremente|ticks|pulses|LSB|lsb|qc", 1.0),
    ],
    "speed": [
        ("rad/s|rad s^-1|rad s⁻¹|rad.s-1|radians per second|Rad/s|RAD/S", 1.0),
        ("deg/s|°/s|degrees per second|deg/sec|dps|deg s-1|DEG/S", DEG),
        ("rpm|RPM|1/min|min-1|min^-1|min⁻¹|U/min|r/min|rev/min|rotations/min|Umdr/min", TURN / 60.0),
        ("revolutions per minute", TURN / 60.0),
        ("rps|rev/s|r/s|turns/s", TURN),
        ("mrad/s", 1e-3),
        ("0.1 rpm", TURN / 600.0),
    ],
    "velocity": [("m/s|m s^-1", 1.0), ("mm/s|mm s-1", 1e-3), ("m/min", 1.0 / 60.0), ("in/s", INCH), ("ft/s", FOOT)],
    "time": [
        ("s|sec|Sek|seconds|second", 1.0), ("ms|msec|milliseconds|0.001 s", 1e-3), ("us|µs|μs|usec", 1e-6),
        ("ns", 1e-9),
        ("min|minutes", 60.0), ("h|hours", 3600.0), ("0.1 ms", 1e-4), ("100 ns", 1e-7), ("10 us", 1e-5),
    ],
}  # fmt: skip
# Not known, or known and not what a column of a record may be in.
REFUSED = (
    "grad|GRAD|mil|mils|deg el|°el|deg (el)|rad_el|degE|el. deg|a.u.|bits|digits|PUU|IU|user|units|u|x|foo|qq|"
    "gcm|kgcm|kg.cm|kg-cm|kg cm|lb|lbs|oz|dyn.cm|Nm/A|Nm/rad|Nm.s|N/m|MNM|MS|mHz|Hz|1/s|degC|K|bar|J/kg|rad/s2|"
    "m/s2|Nm2|bananas|% of max|%FS|counts/s|Nxm|Nm/Nm2|rev2|c|e|k|pi|hbar|q|furlong|hp|Apk|dBm|NaN|N/A|LREAL|"
    "Ncm2|Nm Nm|rad rad"
)
ALLOWED = {
    "time": ("time",),
    "u": ("torque", "force", "share", "current", "voltage"),
    "theta_m": ("angle", "length", "counts", "speed", "velocity"),
}


def truth() -> list[tuple[str, str, str, float | None]]:
    """Each spelling in each column of a record: text, column, kind and factor to SI; None where it must be refused."""
    rows: list[tuple[str, str, str, float | None]] = []
    for column, kinds in ALLOWED.items():
        for kind, entries in KNOWN.items():
            for texts, factor in entries:
                for text in texts.split("|"):
                    if kind in kinds:
                        rows.append((text, column, kind, factor))
                    elif text != "nm":  # small, it is a length, too
                        rows.append((text, column, "", None))
        rows += [(text, column, "", None) for text in REFUSED.split("|")]
    return rows
