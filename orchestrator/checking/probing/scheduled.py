"""The driver of scheduled execution: model partitions are activated when their clocks tick."""

from orchestrator.checking.probing.events import EventDriver
from orchestrator.checking.rules import declare

declare("""
[life cycle]
partition.preemption | E | - | 5.2.1 | preemption is unlocked as often as it is locked | call unlockPreemption on every way out
""")  # noqa: E501


class ScheduledExecution(EventDriver):
    """Scheduled execution of FMI 3.0."""

    def advance(self, t: float, size: float, when: str = "") -> None:
        end = t + size
        while self.next_instant(end) < end:
            now = self.next_instant(end)
            for clock in self.due(now):
                at = f"for the clock `{clock.name}` at t = {now:g}"
                self.library.threaded = self.habits.threads
                try:
                    self.call("ActivateModelPartition", clock.reference, now, when=at)
                finally:
                    self.library.threaded = False
                self._hold({clock.reference}, at)
                self._advance_clocks([clock], now)
        _, locks = self.library.updates()
        if locks:
            message = "preemption must be unlocked as often as it is locked, but is not"
            self.report("partition.preemption", message, when=when)
