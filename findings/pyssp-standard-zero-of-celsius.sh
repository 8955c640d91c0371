#!/usr/bin/env bash
# Guess: add_unit("degC") of pyssp_standard, which makes the base unit of a name by itself, writes factor 1 and offset 273.15, so
#   that kelvin = factor * value + offset as SSP 1.0 says; "degF" gets factor 0.5556 and offset 255.37.
# What happens: the offset is what one degree is in kelvin, not what zero is: 274.15 for degC, a kelvin too much. For degF it is
#   255.93, and the factor is left out, which means 1: 50 degF, 10 degC, become 305.9 K. The file is valid; deg and rpm are right. An
#   importer that converts units sets a winding of 20 degC to 21 degC.
# Version: pyssp_standard 0.9.1, Pint 0.25.3, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pyssp_standard==0.9.1 Pint==0.25.3

cat > run.py <<'PYTHON'
from importlib.metadata import version
from xml.etree import ElementTree

import pint
from pyssp_standard.ssv import SSV

CASES = {"degC": 20.0, "degF": 50.0, "deg": 90.0, "rpm": 60.0}
with SSV("parameters.ssv", "w") as file:
    for unit, value in CASES.items():
        file.add_parameter(f"in_{unit}", "Real", value=value, unit=unit)
        file.add_unit(unit)
units = {e.get("name"): e[0].attrib for e in ElementTree.parse("parameters.ssv").iter() if e.tag.endswith("}Unit")}
print("pyssp_standard", version("pyssp_standard"), "Pint", pint.__version__)
read = {}
for unit, value in CASES.items():
    base = units[unit]
    read[unit] = float(base.get("factor", 1)) * value + float(base.get("offset", 0))
    right = pint.UnitRegistry().Quantity(value, unit).to_base_units()
    print(f"{value} {unit}: {dict(base)} -> {read[unit]:.4f}, by Pint {right:.4f}")
assert float(units["degC"]["offset"]) == 274.15 and abs(read["degC"] - 294.15) < 1e-9
assert "factor" not in units["degF"] and abs(read["degF"] - 305.9278) < 1e-3
assert abs(read["deg"] - 1.570796) < 1e-6 and abs(read["rpm"] - 6.283185) < 1e-6
PYTHON
venv/bin/python run.py
echo "as described"
