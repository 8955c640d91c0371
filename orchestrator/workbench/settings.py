"""Every limit of the workbench, each with one line of why."""

from dataclasses import dataclass

MEBIBYTE = 2**20


@dataclass(frozen=True)
class WorkbenchSettings:
    """What a session may take of this machine.

    Attributes:
        largest_file: bytes of an upload: what the readers of records take, too.
        largest_session: bytes of all uploads: a disk is filled by nobody's mistake.
        largest_request: bytes of what a page asks: model files and tables, no data.
        largest_notes: bytes of what the pages keep of their work: choices and a scenario of some hundred FMUs.
        jobs_at_once: further ones wait: each of them keeps a core busy.
        answer_seconds: that a look at a file or a model may take.
        logs_open: logs whose channels are drawn without reading them anew: each holds a process.
        slider_models: models that stay ready under sliders: each holds an instance of an FMU.
        stop_seconds: that jobs have to clean up when the server ends.
        longest_message: characters of a line that a job writes to standard error.
        messages: lines of one job that are kept.
    """

    largest_file: int = 500_000_000
    largest_session: int = 4_000_000_000
    largest_request: int = MEBIBYTE
    largest_notes: int = 4 * MEBIBYTE
    jobs_at_once: int = 4
    answer_seconds: float = 120.0
    logs_open: int = 3
    slider_models: int = 3
    stop_seconds: float = 10.0
    longest_message: int = 2000
    messages: int = 60
