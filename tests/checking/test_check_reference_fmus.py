"""No false alarm on the Reference FMUs of the Modelica Association, where they are at hand."""

import os
from pathlib import Path

import pytest

from orchestrator.checking.check import check_fmu

FOLDER = os.environ.get("REFERENCE_FMUS")
# True ones: a manifest without description, fixed parameters that are taken between steps; and the reference result in
# Feedthrough.fmu has the columns of the FMI 3.0 model.
EVERYWHERE = {"layered.manifest", "misuse.set-fixed"}
KNOWN = {"Feedthrough.fmu": {"layered.result"}}

pytestmark = pytest.mark.skipif(
    FOLDER is None, reason="REFERENCE_FMUS does not name the folder with the FMI 2.0 Reference FMUs"
)


@pytest.mark.parametrize("path", sorted(Path(FOLDER or ".").glob("*.fmu")) if FOLDER else [], ids=lambda p: p.stem)
def test_a_valid_fmu_has_no_untrue_finding(path: Path) -> None:
    report = check_fmu(path)
    assert {f.rule for f in report.findings} <= EVERYWHERE | KNOWN.get(path.name, set())
    assert report.executed
