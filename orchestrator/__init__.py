"""FMI co-simulation toolchain that measures the backlash of a geared drivetrain."""

import importlib
from typing import Any

from orchestrator.shared.version import __version__

# Public name -> the module that has it. A module is imported when the first of its names is used.
_PUBLIC = {
    "BuildResult": "orchestrator.api.build",
    "ThesisResult": "orchestrator.api.thesis",
    "CalibrationError": "orchestrator.errors",
    "CalibrationResult": "orchestrator.api.calibrate",
    "CheckResult": "orchestrator.api.check",
    "CompensateResult": "orchestrator.api.compensate",
    "ConvergenceError": "orchestrator.errors",
    "DesignResult": "orchestrator.api.design",
    "DiagnosisResult": "orchestrator.api.diagnosed",
    "ExportedSsp": "orchestrator.api.ssp",
    "EstimateResult": "orchestrator.api.estimate",
    "InspectResult": "orchestrator.api.inspect",
    "Experiment": "orchestrator.paired.experiment",
    "FmuError": "orchestrator.errors",
    "FmuDiagnosisResult": "orchestrator.api.any_fmu",
    "InputError": "orchestrator.errors",
    "LocationResult": "orchestrator.api.locate_gap",
    "Model": "orchestrator.records.model_file",
    "NotApplicableError": "orchestrator.estimation.protocol",
    "OrchestratorError": "orchestrator.errors",
    "OutputError": "orchestrator.errors",
    "PairResult": "orchestrator.api.pair",
    "RegulatorResult": "orchestrator.api.regulator",
    "Record": "orchestrator.records.arrays",
    "RecordError": "orchestrator.errors",
    "RunOptions": "orchestrator.api.cases",
    "Scenario": "orchestrator.scenarios.definition",
    "ScenarioError": "orchestrator.errors",
    "SimulationError": "orchestrator.errors",
    "SimulationResult": "orchestrator.api.simulate",
    "ScenarioSweepResult": "orchestrator.api.scenario_sweep",
    "SweepResult": "orchestrator.api.sweep",
    "build": "orchestrator.api.build",
    "calibrate": "orchestrator.api.calibrate",
    "check": "orchestrator.api.check",
    "compensate": "orchestrator.api.compensate",
    "design": "orchestrator.api.design",
    "design_regulator": "orchestrator.api.regulator",
    "diagnose": "orchestrator.api.diagnose",
    "draft_map": "orchestrator.api.any_fmu",
    "draft_model": "orchestrator.api.inspect",
    "estimate": "orchestrator.api.estimate",
    "inspect": "orchestrator.api.inspect",
    "export_ssp": "orchestrator.api.ssp",
    "locate_gap": "orchestrator.api.locate_gap",
    "read_model": "orchestrator.api.records",
    "read_record": "orchestrator.api.records",
    "report": "orchestrator.api.report",
    "run_pair": "orchestrator.api.pair",
    "simulate": "orchestrator.api.simulate",
    "sweep": "orchestrator.api.sweep",
    "sweep_scenario": "orchestrator.api.scenario_sweep",
    "thesis": "orchestrator.api.thesis",
}

__all__ = ["__version__", *_PUBLIC]  # noqa: PLE0604 - names in a dictionary are text


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(importlib.import_module(_PUBLIC[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
