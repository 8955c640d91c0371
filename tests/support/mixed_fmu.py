"""A co-simulation FMU in C with inputs and outputs of every numeric type, built by the tests."""

import subprocess
import zipfile
from pathlib import Path

import fmpy

HERE = Path(__file__).parent
KINDS = ("Real", "Integer", "Boolean")


def _variable(name: str, reference: int, causality: str, kind: str) -> str:
    variability = "continuous" if kind == "Real" else "discrete"
    start = f' start="{"false" if kind == "Boolean" else "0"}"' if causality == "input" else ""
    return (
        f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" '
        f'variability="{variability}"><{kind}{start}/></ScalarVariable>'
    )


def build_mixed_fmu(folder: Path) -> Path:
    """Compile the FMU into ``folder`` and return its path: inputs u, n, b; outputs y, m, c."""
    library = folder / "Mixed.so"
    headers = Path(fmpy.__file__).parent / "c-code"
    command = ["cc", "-shared", "-fPIC", "-I", str(headers), str(HERE / "mixed_fmu.c"), "-o", str(library)]
    subprocess.run(command, check=True, capture_output=True)
    variables = [_variable(n, 0, "input", k) for n, k in zip("unb", KINDS, strict=True)]
    variables += [_variable(n, 1, "output", k) for n, k in zip("ymc", KINDS, strict=True)]
    unknowns = "".join(f'<Unknown index="{n}" dependencies=""/>' for n in (4, 5, 6))
    text = (
        '<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="Mixed" guid="{mixed}">'
        '<CoSimulation modelIdentifier="Mixed" canHandleVariableCommunicationStepSize="true"/>'
        f"<ModelVariables>{''.join(variables)}</ModelVariables>"
        f"<ModelStructure><Outputs>{unknowns}</Outputs></ModelStructure></fmiModelDescription>"
    )
    path = folder / "Mixed.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.write(library, "binaries/linux64/Mixed.so")
    return path
