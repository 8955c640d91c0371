"""Every limit of the workbench, each with one line of why."""

from dataclasses import dataclass

MEBIBYTE = 2**20


@dataclass(frozen=True)
class WorkbenchSettings:
    """What a session may take of this machine."""

    largest_file: int = 500_000_000  # bytes of an upload: what the readers of records take, too
    largest_session: int = 4_000_000_000  # bytes of all uploads: a disk is filled by nobody's mistake
    largest_request: int = MEBIBYTE  # bytes of what a page asks: model files and tables, no data
    # bytes of what the pages keep of their work: choices and a scenario of some hundred FMUs
    largest_notes: int = 4 * MEBIBYTE
    jobs_at_once: int = 4  # further ones wait: each of them keeps a core busy
    answer_seconds: float = 120.0  # that a look at a file or a model may take
    logs_open: int = 4  # logs and FMUs that are shown without reading them anew: each holds a process
    slider_models: int = 3  # models that stay ready under sliders: each holds an instance of an FMU
    stop_seconds: float = 10.0  # that jobs have to clean up when the server ends
    longest_message: int = 2000  # characters of a line that a job writes to standard error
    messages: int = 60  # lines of one job that are kept
